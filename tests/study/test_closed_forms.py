"""The closed forms that a cross-check uses, and its scaling of solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.errors import InputError
from pipeline.core.problem import Kinematics
from pipeline.core.units import MM
from pipeline.equilibrium.solve import solve
from pipeline.inverse.design import Design
from pipeline.study.closed_forms import LONG_BEAM, closed_form_checks, tada_cmod
from pipeline.study.scaling import scaled_problem, scaled_solution, scaling_groups


def test_every_closed_form_holds() -> None:
    failed = [check for check in closed_form_checks() if not check.passed]
    assert not failed


def test_tada_by_hand() -> None:
    """V₁(0.25) = 0.76 − 0.57 + 0.241875 − 0.031875 + 1.173333 = 1.573333; E' = 10.667 GPa."""
    by_hand = 24 * 0.015 * 1.5733333333 / (0.04 * 0.06 * 10e9 / (1 - 1 / 16))
    assert tada_cmod(LONG_BEAM) == pytest.approx(by_hand, rel=1e-9)  # digits written


def test_a_solution_scaled_is_that_of_the_scaled_problem() -> None:
    beam = small_beam(2.8 * MM, cmod_max=0.15 * MM)
    simulated, derived = solve(scaled_problem(beam, 1.25)), scaled_solution(solve(beam), beam, 1.25)
    # round-off may place an increment elsewhere; stations are hit, and paths agree within the residual.
    # 2e-9, 9e-11 and 4e-11 where increments are the same; the energy is of trapezoids over them, good to 1e-3
    at = 1.25 * beam.stations
    assert derived.curve.load_at(at) == pytest.approx(simulated.curve.load_at(at), rel=5e-4)
    off = np.linalg.norm(derived.displacement - simulated.displacement)
    assert off < 1e-4 * np.linalg.norm(simulated.displacement)
    assert derived.energy.dissipated == pytest.approx(simulated.energy.dissipated, rel=1e-3)
    assert derived.curve.time == pytest.approx(np.maximum.accumulate(derived.curve.cmod) / beam.cmod_rate, rel=1e-12)
    assert np.array_equal(derived.cmod, 1.25 * beam.stations)


def test_finite_kinematics_is_not_scaled() -> None:
    beam = replace(small_beam(2.8 * MM), kinematics=Kinematics.FINITE)
    with pytest.raises(InputError, match="small kinematics"):
        scaled_problem(beam, 2.0)


def test_the_paper_s_grid_holds_four_nodes_twice() -> None:
    groups = scaling_groups(Design((71.0, 1.14e-4)).nodes())
    assert len(groups) == 21, "25 nodes, of which the diagonal is one test at five scales"
    [diagonal] = [group for group in groups if len(group) > 1]
    assert [factor for _, factor in diagonal] == pytest.approx([1, 1.1 / 1.2, 1 / 1.2, 0.9 / 1.2, 0.8 / 1.2])
