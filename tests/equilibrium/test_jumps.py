"""A crack that jumps: the energy it sets free is counted, and under which control it jumps is a choice."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.problem import Problem, Solution
from pipeline.core.units import MM
from pipeline.equilibrium.solve import solve
from pipeline.materials.cohesive import LinearSoftening

from .specimens import chain, fracture_test


def test_a_bond_on_a_soft_spring_sets_the_closed_form_free() -> None:
    """Where the machine cannot move back, all that spring and bond hold at f_max goes, less what the bond takes."""
    force, spring, peak, last = 80.0, 4e6, 2e-7, 1e-5
    law = LinearSoftening(np.array([4e8]), np.array([force]), np.array([last]))
    solution = solve(chain(spring, law, 1.2e-5), snap_back=False)
    released = force**2 / (2 * spring) + force * peak / 2 - force * last / 2
    assert np.diff(solution.curve.load_line).min() > 0
    assert "jumped once" in solution.message
    assert solution.energy.damping == pytest.approx(released, rel=0.04)  # a sixteenth of an increment past the peak
    assert solution.energy.error < 1e-9  # round-off: one jump, and the rest is linear


@pytest.fixture(scope="module")
def brittle() -> Problem:
    """A beam of scattered strength that snaps back even under CMOD control."""
    return fracture_test(radius=2.5 * MM, scatter=0.8, opening=0.3e-4)


@pytest.fixture(scope="module")
def solutions(brittle: Problem) -> dict[bool, Solution]:
    return {snap_back: solve(brittle, snap_back=snap_back) for snap_back in (True, False)}


def test_energy_balances_through_jumps(solutions: dict[bool, Solution]) -> None:
    for solution in solutions.values():
        assert "jumped" in solution.message
        assert solution.energy.damping > 1e-3 * solution.energy.external  # the balance would be missed without it
        assert solution.energy.error < 1e-3  # trapezoids over the increments


def test_a_machine_that_only_moves_forward_sets_more_free(solutions: dict[bool, Solution]) -> None:
    free, forward = solutions[True], solutions[False]
    assert np.diff(free.curve.load_line).min() < 0 < np.diff(forward.curve.load_line).min()
    assert forward.energy.damping > 1.5 * free.energy.damping
    # the same crack: scattered strengths decide where it runs, not how it is driven
    assert forward.energy.dissipated == pytest.approx(free.energy.dissipated, rel=0.01)


# relative scatter of strength, and δ_max (m): no equilibrium has the next CMOD, wherever the machine is
@pytest.mark.parametrize(("scatter", "opening"), [(0.5, 0.15e-4), (0.7, 0.2e-4), (0.9, 0.3e-4)])
def test_a_crack_goes_on_where_neither_control_has_an_equilibrium(scatter: float, opening: float) -> None:
    problem = fracture_test(radius=2.5 * MM, scatter=scatter, opening=opening)
    solution = solve(problem)
    assert solution.converged
    assert solution.curve.cmod[-1] == pytest.approx(problem.cmod_max)
    assert "jumped" in solution.message
    assert solution.energy.error < 1e-3  # what is set free is counted
