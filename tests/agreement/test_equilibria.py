"""Bonds that open and slide: explicit runs through failure against the equilibria that they must approach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.problem import Kinematics, Problem, Solution
from pipeline.core.specimen import DiskCompactTension
from pipeline.core.units import GPA, MM
from pipeline.equilibrium.solve import solve
from pipeline.lmp import simulate
from pipeline.materials.elastic import Plane
from pipeline.materials.mixture import Mixture
from pipeline.materials.softening import Shape, Softening, Unloading
from pipeline.microstructure.attachment import attach_gauge, attach_grips
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phases import lay_phases
from pipeline.reference import solve as steps

SLIDING = {"shear_strength_ratio": 0.7, "shear_opening_ratio": 1.2}
DISK = DiskCompactTension(
    diameter=150 * MM, width=110 * MM, edge_to_load_line=35 * MM, thickness=50 * MM, notch_length=27.5 * MM
)


def disk(**options) -> Problem:
    """The paper's DC(T) in plane stress at ν = 0.2, rows of the lattice at 17° to the crack."""
    particles, bonds, _ = lay_phases(DISK, hexagonal_packing(DISK, 2.5 * MM, np.deg2rad(107)))
    f_max, delta_max, kinematics = 740.0, 1.14e-4, options.pop("kinematics", Kinematics.SMALL)
    mixture = Mixture(10 * GPA, 50 * GPA, 0.2, Plane.STRESS, f_max, delta_max, **SLIDING, **options)
    return Problem(
        specimen=DISK,
        particles=particles,
        bonds=bonds,
        law=mixture.law(bonds, DISK.thickness, f_max, delta_max),
        grips=attach_grips(DISK, particles),
        gauge=attach_gauge(DISK, particles),
        kinematics=kinematics,
        cmod_max=1.2 * MM,
        stations=np.linspace(0.1, 1.1, 6) * MM,
    )


def beam(**options) -> Problem:
    """A two-phase SE(B) in plane strain at ν = 0.2."""
    return small_beam(2.8 * MM, cmod_max=0.4 * MM, poissons_ratio=0.2, **SLIDING, **options)


CASES: dict[str, Callable[[], Problem]] = {
    "beam": beam,
    "beam, friction": lambda: beam(friction=0.5),
    "beam, finite, exponential, elastic unloading": lambda: beam(
        kinematics=Kinematics.FINITE, softening=Softening(Shape.EXPONENTIAL), unloading=Unloading.ELASTIC
    ),
    "disk": disk,
    "disk, finite": lambda: disk(kinematics=Kinematics.FINITE),
}


def apart(run: Solution, limit: Solution, end: float) -> tuple[float, float]:
    """Relative differences in load, over the curve, and in displacement, at the worst station."""
    at = np.linspace(0.03, 0.97, 200) * end
    load, exact = run.curve.load_at(at), limit.curve.load_at(at)
    fields = zip(run.displacement, limit.displacement, strict=True)
    field = max(np.linalg.norm(u - v) / np.linalg.norm(v) for u, v in fields)
    return float(np.linalg.norm(load - exact) / np.linalg.norm(exact)), float(field)


@pytest.mark.parametrize("name", CASES)
def test_slow_explicit_runs_end_at_the_equilibria(name: str, tmp_path: Path) -> None:
    problem = CASES[name]()
    limit = solve(problem, snap_back=False)
    assert np.sum(limit.reached > 0.9 * problem.law.delta_max) >= 10, "bonds broke on the way"
    assert limit.energy.error < 1e-3  # trapezoids over the increments
    found = []
    for accuracy in (0.03, 0.003):
        (tmp_path / str(accuracy)).mkdir()
        run = simulate.solve(replace(problem, accuracy=accuracy), tmp_path / str(accuracy))
        found.append(apart(run, limit, problem.cmod_max))
    coarse, fine = found
    assert max(fine) < 5e-3  # asked for: 3e-3, and what the increments leave; measured 0.8e-3 to 2.9e-3
    assert fine[0] < 0.5 * coarse[0]  # measured: a quarter to a seventh


@pytest.mark.slow
def test_the_numpy_steps_end_there_too() -> None:
    problem = replace(beam(friction=0.5), cmod_max=0.2 * MM, stations=np.array([0.05, 0.1, 0.15]) * MM, accuracy=0.01)
    run, limit = steps.solve(problem), solve(problem, snap_back=False)
    load, field = apart(run, limit, problem.cmod_max)
    assert load < 0.02  # twice what was asked for; measured 0.006 and 0.004
    assert field < 0.02
