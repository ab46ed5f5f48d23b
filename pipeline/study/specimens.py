"""Specimens on which engines are compared: synthetic sections of both geometries, a bond in series with a spring."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import Gauge, Grip, Kinematics, Problem, Role
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.core.units import MM
from pipeline.materials.burgers import Burgers
from pipeline.materials.cohesive import LinearSoftening
from pipeline.store.bundle import read_bundle
from pipeline.store.creep import CreepRecord
from pipeline.store.new import Contents, write_bundle
from pipeline.store.start import start_parameters
from pipeline.study.assembly import CREEPING, build_model
from pipeline.study.creep_trials import READINGS
from pipeline.study.request import Request
from pipeline.study.virtual_test import prepare

CMOD_MAX = {"seb": 0.55 * MM, "dct": 0.6 * MM}


@dataclass(frozen=True)
class Trial:
    """One fracture test on which engines are compared.

    Parameters
    ----------
    name : str
    problem : Problem
    points : (p, 2) array, m; where displacements are compared
    """

    name: str
    problem: Problem
    points: np.ndarray

    def with_kinematics(self, kinematics: Kinematics) -> Trial:
        """The same test with another measure of opening."""
        return replace(self, problem=replace(self.problem, kinematics=kinematics))

    def with_accuracy(self, accuracy: float) -> Trial:
        """The same test at another accuracy asked for."""
        return replace(self, problem=replace(self.problem, accuracy=accuracy))


def section_trial(
    geometry: str,
    radius_mm: float,
    seed: int | None,
    angle_deg: float = 90.0,
    poissons_ratio: float = 0.25,
    mastic: Burgers | None = None,
) -> Trial:
    """A test of a synthetic section with the paper's properties.

    Parameters
    ----------
    geometry : "seb" or "dct"
    radius_mm : float; of the particles
    seed : int, of the section; None: mastic throughout
    angle_deg : float; direction of the close-packed rows against x, 90 along the crack
    poissons_ratio : float; below 1/4 bonds slide, weaker and further than they open, and particles rotate
    mastic : Burgers; how the mastic creeps, if it does, in the time of the paper's test
    """
    experiment, images = prepare(Request(geometry), geometry, np.random.default_rng(seed or 0))
    turned = experiment.model.model_copy(update={"lattice_angle_deg": angle_deg})
    sliding = {"shear_strength_ratio": 0.7, "shear_opening_ratio": 1.2} if poissons_ratio < 0.25 else {}
    material = experiment.material.model_copy(update={"poissons_ratio": poissons_ratio, **sliding})
    experiment = experiment.model_copy(update={"model": turned, "material": material})
    contents = images if seed is not None else Contents()
    if mastic is not None:
        contents = replace(contents, creep=CreepRecord(READINGS, mastic.creep_compliance(READINGS)))
    with tempfile.TemporaryDirectory() as folder:
        write_bundle(Path(folder), experiment, contents)
        bundle = read_bundle(Path(folder))
        model = build_model(bundle, radius_mm * MM)
        law = None if mastic is None else CREEPING
        problem = model.problem(*start_parameters(bundle), cmod_max=CMOD_MAX[geometry], law=law)
    what = "homogeneous" if seed is None else f"section {seed}"
    name = f"{geometry}, {what}, {radius_mm:g} mm, {angle_deg:g}°" + (", sliding" if sliding else "")
    name += "" if mastic is None else ", creeping"
    return Trial(name, problem, bundle.observation_points)


def bond_in_series(spring: float = 1e9) -> Problem:
    """A cohesive bond in series with a spring (N/m): three particles in line, the gauge across the bond.

    Its load–CMOD curve is the law itself: 80 N, 4e8 N/m, 10 µm.
    """
    position = np.array([[0.0, 0.0], [1 * MM, 0.0], [2 * MM, 0.0]])
    particles = Particles(position, 0.5 * MM, np.full(3, Phase.MASTIC, np.uint8), np.zeros(3, np.int32))
    pairs = np.array([[0, 1], [1, 2]], np.int32)
    bonds = Bonds(pairs, np.full(2, Phase.MASTIC, np.uint8), np.zeros(2, bool))
    grips = (
        _grip("left", 0, (-1.0, 0.0), 0.0, Role.REACT),
        _grip("right", 2, (1.0, 0.0), 1.0, Role.DRIVE),
        *(_grip(f"line_{i}", i, (0.0, 1.0), 0.0, Role.GUIDE) for i in range(3)),
    )
    beam = SingleEdgeNotchedBeam(60 * MM, 130 * MM, 137 * MM, 40 * MM, 15 * MM)
    law = LinearSoftening(np.array([4e8, spring]), np.array([80.0, np.inf]), np.array([1e-5, np.inf]))
    gauge, end = Gauge(np.array([1, 0]), np.array([1.0, -1.0])), 1.2e-5
    return Problem(beam, particles, bonds, law, grips, gauge, Kinematics.SMALL, end, np.linspace(0.2, 0.8, 4) * end)


def _grip(name: str, particle: int, direction: tuple[float, float], drive: float, role: Role) -> Grip:
    return Grip(name, np.array([particle]), np.ones(1), np.array(direction), drive, role)
