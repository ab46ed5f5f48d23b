"""The specimens of a check: drawn, and broken with engine C."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.blind.calibration import SLIDING
from pipeline.blind.equilibrium import Path as Broken
from pipeline.blind.equilibrium import Setup
from pipeline.blind.equilibrium import solve as break_triangles
from pipeline.blind.sample import PHYSICS, Material, Sample, continuum, setup_of
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.microstructure.phase_map import PhaseMap, from_labels
from pipeline.store.experiment import Experiment
from pipeline.study.blind_check.cases import STRANGERS, Case, Size
from pipeline.study.request import Request
from pipeline.study.typical_creep import FLOW, SHARE, TIME
from pipeline.study.virtual_test import prepare

SPREAD = 0.12  # the truth lies within ± this share of the start
MESHES = 6  # tried until one can be followed to the end


@dataclass(frozen=True, eq=False)
class Drawn:
    """One specimen before it is tested: settings, labels, phases, its true strength."""

    experiment: Experiment
    labels: np.ndarray
    phase_map: PhaseMap
    f_max: float
    delta_max: float

    @property
    def specimen(self) -> Specimen:
        return self.experiment.specimen.specimen()


def draw(geometry: str, size: Size, rng: np.random.Generator) -> Drawn:
    """A specimen with its section and its truth."""
    of_section, of_truth = rng.spawn(2)
    request = Request(geometry=geometry, radius_mm=size.radius_mm)
    experiment, contents = prepare(request, "specimen", of_section)
    loading = experiment.loading.model_copy(update={"cmod_max_mm": size.cmod_max_mm[geometry]})
    experiment = experiment.model_copy(update={"loading": loading})
    assert contents.labels is not None
    assert experiment.specimen.image is not None
    assert experiment.start is not None
    phase_map, _ = from_labels(contents.labels, experiment.specimen.image.placement())
    share = of_truth.uniform(1 - SPREAD, 1 + SPREAD, 2)
    truth = experiment.start.f_max_n * share[0], experiment.start.delta_max_m * share[1]
    return Drawn(experiment, contents.labels, phase_map, float(truth[0]), float(truth[1]))


def crack(case: Case, drawn: Drawn, size: Size, seed: int) -> tuple[Setup, Broken]:
    """Break the specimen of a case."""
    physics = {n: v for n, v in case.effects.items() if n in PHYSICS}
    material, specimen = material_of(drawn), drawn.specimen
    if case.stranger is not None:
        name, value = case.stranger
        if name not in STRANGERS:
            raise InputError(f"{name} is no stranger: it must be one of {', '.join(STRANGERS)}")
        if name == "aggregate_modulus":
            material = replace(material, aggregate_modulus=(1 + value) * material.aggregate_modulus)
        else:
            other: Any = specimen
            specimen = replace(other, gauge_length=(1 + value) * specimen.gauge_length)
    sample = Sample(
        specimen=specimen,
        phase_at=drawn.phase_map.at,
        material=material,
        effects=physics,
        edge=size.edge_mm * MM,
        cmod_rate=drawn.experiment.loading.cmod_rate,
    )
    assert drawn.experiment.loading.cmod_max is not None
    return broken_on_some_mesh(sample, [seed, 7, case.specimen], 1.002 * drawn.experiment.loading.cmod_max)


def broken_on_some_mesh(sample: Sample, seed: list[int], cmod_max: float) -> tuple[Setup, Broken]:
    """The sample broken on the first of a few meshes on which it can be followed.

    Raises
    ------
    ConvergenceError
        where none can: the last one's reason
    """
    for attempt in range(MESHES):
        try:
            setup = setup_of(sample, np.random.default_rng([*seed, attempt] if attempt else seed))
            return setup, break_triangles(setup, cmod_max)
        except ConvergenceError:
            if attempt == MESHES - 1:
                raise
    raise AssertionError("unreachable: the last mesh returns or raises")


def material_of(drawn: Drawn) -> Material:
    """What the bundle's settings mean for the continuum of engine C."""
    e = drawn.experiment
    m, radius, thickness = e.material, e.model.particle_radius_mm * MM, drawn.specimen.thickness
    assert m.mastic_modulus is not None
    assert m.aggregate_modulus is not None
    assert e.start is not None
    strength, energy = continuum(drawn.f_max, drawn.delta_max, radius, thickness)
    stone = continuum(
        m.aggregate_strength_ratio * e.start.f_max_n, m.aggregate_opening_ratio * e.start.delta_max_m, radius, thickness
    )
    d1 = 1 / m.mastic_modulus
    return Material(
        mastic_modulus=m.mastic_modulus,
        aggregate_modulus=m.aggregate_modulus,
        poissons_ratio=m.poissons_ratio,
        plane=m.plane,
        strength=strength,
        energy=energy,
        stone_strength=stone[0],
        stone_energy=stone[1],
        interface_strength=m.interface_strength_ratio,
        interface_opening=m.interface_opening_ratio,
        touching_is_stone=m.touching == "aggregate",
        shear=SLIDING * m.shear_strength_ratio,
        creep=(d1, SHARE * d1, FLOW / d1, TIME),
    )
