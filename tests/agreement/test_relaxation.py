"""A relaxation step inside a run of every engine, one bond and a patch, against the closed form E(t)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.patches import MASTIC, STEP, patch, relaxed

from pipeline.core.problem import Problem, Solution
from pipeline.equilibrium import solve as equilibrium
from pipeline.lmp import simulate as lammps
from pipeline.materials.cohesive import LinearSoftening
from pipeline.reference import solve as reference

SHAPES = {"one bond": (6, 1), "patch": (20, 15)}  # a chain of five equal bonds, and 300 particles


def stiffness(problem: Problem) -> float:
    """N/m of the same patch without creep."""
    law = problem.law
    elastic = replace(problem, clock=None, law=LinearSoftening(law.k_n, law.f_max, law.delta_max))
    curve = equilibrium.solve(elastic, tolerance=1e-9).curve
    return float(curve.load[-1] / curve.cmod[-1])


def error(problem: Problem, solution: Solution, settled: float = 1.0) -> float:
    """Largest relative difference of the load from the closed form, once `settled` times the step is passed."""
    after = solution.curve.cmod >= settled * STEP * (1 - 1e-12)
    cmod, load = solution.curve.cmod[after], solution.curve.load[after]
    assert after.sum() > 10
    return float(np.abs(load / (stiffness(problem) * cmod * relaxed(cmod)) - 1).max())


def test_the_closed_form_is_the_integral_of_the_modulus() -> None:
    """ε₀ E(t) + ∫ E(t − s) ε̇ ds by quadrature."""
    at = np.array([1.0, 1.3, 2.0])
    for share in at:
        time = 60.0 * (share - 1)
        grid = np.linspace(0, time, 20001)
        modulus = MASTIC.relaxation_modulus(grid)
        whole = MASTIC.relaxation_modulus(np.array([time]))[0] + np.trapezoid(modulus, grid) / 60.0
        assert relaxed(np.array([share * STEP]))[0] == pytest.approx(MASTIC.d1 * whole / share, rel=1e-8)  # trapezoids


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_equilibrium(shape: tuple[int, int]) -> None:
    """Openings are linear in time within increments, so that every step is exact."""
    problem = patch(*shape)
    solution = equilibrium.solve(problem, tolerance=1e-9)
    assert error(problem, solution) < 1e-6  # asked for; measured 1e-9, the step's own duration
    assert solution.energy.error < 1e-3  # trapezoids


@pytest.mark.parametrize("shape", [(6, 1), (9, 5)], ids=SHAPES)
def test_steps_in_numpy(shape: tuple[int, int]) -> None:
    problem = replace(patch(*shape), accuracy=1e-3 if shape[1] == 1 else 1e-2)
    assert error(problem, reference.solve(problem), 1.05) < 1e-3  # asked for


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_lammps(shape: tuple[int, int]) -> None:
    problem = replace(patch(*shape), accuracy=1e-3 if shape[1] == 1 else 1e-2)
    assert error(problem, lammps.solve(problem), 1.05) < 1e-3  # asked for
