"""From a bundle to a bonded-particle model of its specimen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pipeline.config import RunSettings, load_settings, run_settings
from pipeline.core.clock import Clock, steady
from pipeline.core.errors import InputError
from pipeline.core.particles import Bonds, Particles
from pipeline.core.problem import Gauge, Grip, Problem
from pipeline.core.units import GPA
from pipeline.materials.burgers import Burgers
from pipeline.materials.creeping_mixture import creeping_law
from pipeline.materials.mixture import Mixture
from pipeline.materials.softening import Shape, Softening, Unloading, named_shape
from pipeline.microstructure.attachment import attach_gauge, attach_grips, gauge_remark
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phase_map import PhaseMap, from_labels
from pipeline.microstructure.phases import PackingReport, lay_phases
from pipeline.microstructure.segment import segment
from pipeline.store import creep
from pipeline.store.bundle import Bundle
from pipeline.store.images import read_grey, read_labels
from pipeline.store.start import start_parameters
from pipeline.study.creep_analysis import mastic_creep

CREEPING = "burgers"  # the name of the law whose mastic creeps
PRE_PEAK = (0.25, 0.5, 0.75)  # of the CMOD at peak: frames kept for the diagnosis


@dataclass(frozen=True)
class Model:
    """A specimen as particles and bonds, with everything but the two unknowns.

    Parameters
    ----------
    bundle : Bundle
    phase_map : PhaseMap or None; None is mastic throughout
    particles : Particles
    bonds : Bonds
    grips : tuple of Grip
    gauge : Gauge
    mixture : Mixture
    report : PackingReport
    remarks : tuple of str; what a user should know
    """

    bundle: Bundle
    phase_map: PhaseMap | None
    particles: Particles
    bonds: Bonds
    grips: tuple[Grip, ...]
    gauge: Gauge
    mixture: Mixture
    report: PackingReport
    remarks: tuple[str, ...]

    @cached_property
    def burgers(self) -> Burgers:
        """The mastic's creep as creep.csv of the bundle has it; refuses where there is none."""
        return mastic_creep(self.bundle).burgers

    @property
    def force_scale(self) -> float:
        """f_max of this lattice over f_max of the bundle's: f_max/(2 r t) is kept."""
        return self.particles.radius / self.bundle.model.radius

    def problem(
        self,
        f_max: float,
        delta_max: float,
        *,
        frames: np.ndarray | None = None,
        cmod_max: float | None = None,
        accuracy: float = 0.01,
        law: str | None = None,
    ) -> Problem:
        """The fracture test at one pair of parameters.

        Parameters
        ----------
        f_max : float, N; of a mastic bond of the *bundle's* lattice, rescaled here
        delta_max : float, m
        frames : (k,) array, m; CMOD of the full fields, those of `frame_stations` by default
        cmod_max : float, m; end of the test, the bundle's by default
        accuracy : float; quasi-static error asked for
        law : str; a shape of softening instead of the bundle's, or "burgers": the mastic creeps as creep.csv says
        """
        creeps = law == CREEPING
        shape = self.mixture.softening if law is None or creeps else Softening(named_shape(law))
        mixture = replace(self.mixture, softening=shape)
        properties = self.bonds, self.bundle.specimen.thickness, f_max * self.force_scale, delta_max
        end = self.bundle.cmod_max if cmod_max is None else cmod_max
        wanted = frame_stations(self.bundle) if frames is None else frames
        return Problem(
            specimen=self.bundle.specimen,
            particles=self.particles,
            bonds=self.bonds,
            law=creeping_law(mixture, self.burgers, *properties) if creeps else mixture.law(*properties),
            grips=self.grips,
            gauge=self.gauge,
            kinematics=self.bundle.model.motion,
            cmod_max=end,
            stations=wanted[wanted <= end],
            accuracy=accuracy,
            cmod_rate=self.bundle.loading.cmod_rate,
            clock=test_clock(self.bundle) if creeps else None,
        )

    def placed(self, shift: tuple[float, float]) -> Model:
        """The same specimen on the same lattice moved by a shift (2,), m."""
        return _packed(self.bundle, self.phase_map, self.mixture, self.particles.radius, (), shift)


def build_model(bundle: Bundle, radius: float | None = None) -> Model:
    """Read the specimen's image, pack particles, lay phases, attach grips and gauge.

    Parameters
    ----------
    bundle : Bundle
    radius : float, m; of the particles, the bundle's by default

    Raises
    ------
    InputError, UnavailableError
        where image, specimen or material are refused
    """
    refuse_untold(bundle)
    phase_map, remarks = read_phases(bundle)
    material = mixture(bundle, radius)
    if bundle.material.mastic_modulus is None:
        remarks += (f"modulus of the mastic {material.mastic_modulus / GPA:.4g} GPa, 1/D₁ of {creep.FILE}",)
    return _packed(bundle, phase_map, material, radius or bundle.model.radius, remarks)


def _packed(
    bundle: Bundle,
    phase_map: PhaseMap | None,
    material: Mixture,
    radius: float,
    remarks: tuple[str, ...],
    shift: tuple[float, float] = (0.0, 0.0),
) -> Model:
    """Particles and bonds of a specimen whose phases are known, with what has to be said of them."""
    packing = hexagonal_packing(bundle.specimen, radius, bundle.model.lattice_angle, shift)
    particles, bonds, report = lay_phases(bundle.specimen, packing, phase_map)
    remark = gauge_remark(bundle.specimen, particles)
    if report.islands or report.loose:
        remarks += (f"{report.islands + report.loose} particles did not hold to the specimen and were left out",)
    return Model(
        bundle=bundle,
        phase_map=phase_map,
        particles=particles,
        bonds=bonds,
        grips=attach_grips(bundle.specimen, particles),
        gauge=attach_gauge(bundle.specimen, particles),
        mixture=material,
        report=report,
        remarks=remarks + ((remark,) if remark else ()),
    )


def read_phases(bundle: Bundle) -> tuple[PhaseMap | None, tuple[str, ...]]:
    """The phases of a bundle's specimen, and what to know of how they were found; None: all mastic."""
    if bundle.labels is None and bundle.specimen_image is None:
        return None, ("no image of the specimen: it is mastic throughout",)
    if bundle.image_frame is None:
        raise InputError("experiment.toml: an image of the specimen needs [specimen.image]: mm_per_px and origin_px")
    placement = bundle.image_frame.placement()
    if bundle.labels is not None:
        with _told_of(bundle.labels):
            phase_map, stones = from_labels(read_labels(bundle.labels), placement)
        return phase_map, (f"{stones.count} stones, {stones.small} below 2.36 mm counted as mastic",)
    assert bundle.specimen_image is not None
    with _told_of(bundle.specimen_image):
        found = segment(grey_levels(read_grey(bundle.specimen_image)), placement)
    told = (
        f"{found.stones} stones ({found.split} by splitting touching ones, {found.small} below 2.36 mm counted as "
        f"mastic), aggregate {found.aggregate_fraction:.1%} of the photograph, taken as {found.aggregate_is}"
    )
    return found.phase_map, (told,)


@contextmanager
def _told_of(image: Path) -> Iterator[None]:
    """Begin every refusal with the name of the image it is about."""
    try:
        yield
    except InputError as error:
        told = str(error)
        raise InputError(told if told.startswith(image.name) else f"{image.name}: {told}") from error


def mixture(bundle: Bundle, radius: float | None = None) -> Mixture:
    """The material of a bundle for particles of a radius (m), in SI."""
    material = bundle.material
    f_max, delta_max = start_parameters(bundle, radius)
    modulus = material.mastic_modulus or 1 / mastic_creep(bundle).burgers.d1  # as the paper's elastic model has it
    return Mixture(
        mastic_modulus=modulus,
        aggregate_modulus=material.aggregate_modulus or modulus,
        poissons_ratio=material.poissons_ratio,
        plane=material.plane_state,
        f_max_start=f_max,
        delta_max_start=delta_max,
        interface_strength_ratio=material.interface_strength_ratio,
        interface_opening_ratio=material.interface_opening_ratio,
        aggregate_strength_ratio=material.aggregate_strength_ratio,
        aggregate_opening_ratio=material.aggregate_opening_ratio,
        aggregate_follows=material.aggregate_follows,
        touching=material.touching,
        shear_strength_ratio=material.shear_strength_ratio,
        shear_opening_ratio=material.shear_opening_ratio,
        softening=Softening(Shape(material.softening)),
        unloading=Unloading(material.unloading),
    )


def refuse_untold(bundle: Bundle) -> None:
    """Refuse what nobody could tell from a test."""
    material = bundle.material
    ratio = material.plane_state.central_force_ratio
    shear = (material.shear_strength_ratio, material.shear_opening_ratio)
    if shear != (1.0, 1.0) and abs(material.poissons_ratio - ratio) < 1e-3:
        raise InputError(
            f"shear_strength_ratio and shear_opening_ratio = {shear} cannot be identified: at poissons_ratio = "
            f"{material.poissons_ratio:g} bonds carry no shear (K^s = 0); leave them at 1"
        )


def test_clock(bundle: Bundle) -> Clock:
    """Time of the test against its CMOD: of the record where there is one, else at the rate that was set."""
    if bundle.curve is None:
        return steady(bundle.loading.cmod_rate)
    cmod, time = bundle.curve.cmod, bundle.curve.time
    opened = np.flatnonzero(cmod > np.maximum.accumulate(np.concatenate([[0.0], cmod[:-1]])))
    rest = time[max(opened[0] - 1, 0)] if opened.size else time[0]  # before the mouth opened nothing was loaded
    after = opened[time[opened] > rest]
    return Clock(np.concatenate([[0.0], cmod[after]]), np.concatenate([[0.0], time[after] - rest]))


def frame_stations(bundle: Bundle) -> np.ndarray:
    """CMOD (m) at which full fields are kept: before the peak, and the stations of the comparison."""
    if bundle.curve is None:
        step = bundle.observation.cmod_step
        return step * np.arange(1, bundle.observation.cmod_count + 1)
    peak = bundle.stations[0]
    return np.concatenate([peak * np.array(PRE_PEAK), bundle.stations])


def grey_levels(image: np.ndarray) -> np.ndarray:
    """Whole grey levels of 8 or 16 bits from floating-point ones."""
    top = float(image.max())
    if image.min() < 0 or top > np.iinfo(np.uint16).max:
        raise InputError(f"grey levels from {image.min():g} to {top:g} are not of 8 or 16 bits: export the image so")
    return np.rint(image).astype(np.uint8 if top <= np.iinfo(np.uint8).max else np.uint16)


def settings_of(config: Path | None, **options: object) -> RunSettings:
    """Settings of a run: a file's, if one is given, and options over it."""
    return load_settings(config, options) if config else run_settings(options)
