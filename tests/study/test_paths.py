"""The path that a run is judged by: the nearest, of specimens that are nearly the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import Solution
from pipeline.equilibrium.solve import solve
from pipeline.study.paths import NEARLY, OTHERS, apart, nearest_path, nearly
from pipeline.study.specimens import Trial, bond_in_series


@pytest.fixture(scope="module")
def trial() -> Trial:
    return Trial("a bond", bond_in_series(), np.empty((0, 2)))


@pytest.fixture(scope="module")
def solution(trial: Trial) -> Solution:
    return solve(trial.problem)


def with_load(solution: Solution, factor: float) -> Solution:
    """The same solution with another load, and a field that no point is asked of."""
    curve = solution.curve
    return replace(solution, curve=LoadCurve(curve.time, curve.cmod, factor * curve.load, curve.load_line))


def test_strengths_change_a_little_and_the_same_way_each_time(trial: Trial) -> None:
    law, other = trial.problem.law, nearly(trial, 3).problem.law
    finite = np.isfinite(law.f_max)
    share = np.abs(other.f_max[finite] / law.f_max[finite] - 1)
    assert np.all((share > 0) & (share <= NEARLY))
    assert np.all(np.isinf(other.f_max[~finite])), "what takes no damage still takes none"
    assert np.array_equal(other.delta_max, law.delta_max)
    assert np.array_equal(nearly(trial, 3).problem.law.f_max, other.f_max)
    assert not np.array_equal(nearly(trial, 4).problem.law.f_max, other.f_max)


def test_the_first_path_that_is_near_enough_is_taken(
    trial: Trial, solution: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.study.paths.field_difference", lambda *_: 0.0)  # there are no points
    asked: list[str] = []

    def other(asked_of: Trial) -> Solution:
        asked.append(asked_of.name)
        return with_load(solution, [1.2, 1.1, 1.004, 1.0][len(asked) - 1])

    near = nearest_path(trial, solution, 0.01, other)
    assert asked == ["a bond", "a bond, strengths 1", "a bond, strengths 2"]
    assert near.path == 2
    assert near.curve == pytest.approx(0.004 / 1.004, rel=1e-9)  # round-off


def test_where_none_is_near_enough_the_nearest_is_told(
    trial: Trial, solution: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.study.paths.field_difference", lambda *_: 0.0)
    factors = iter([1.2, 1.1, 1.05, *[1.3] * OTHERS])
    near = nearest_path(trial, solution, 0.01, lambda _: with_load(solution, next(factors)))
    assert near.path == 2
    assert near.curve == pytest.approx(0.05 / 1.05, rel=1e-9)  # round-off


def test_a_run_that_ended_early_is_near_to_nothing(trial: Trial, solution: Solution) -> None:
    short = replace(solution, displacement=solution.displacement[:-1])
    assert np.isnan(apart(trial, short, solution)[1])
