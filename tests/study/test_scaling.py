"""The scaling law spares simulations only where it is exact."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.bundles import DELTA_MAX, F_MAX, edit, make_bundle

from pipeline.core.errors import InputError
from pipeline.core.problem import Problem, Solution
from pipeline.core.units import MM
from pipeline.equilibrium.solve import solve
from pipeline.execution.progress import Silent
from pipeline.materials.cohesive import LinearSoftening
from pipeline.study.agreement import curve_difference
from pipeline.study.identify import identify
from pipeline.study.ratios import between
from pipeline.study.scaling import leading_problem, member_solution, scaling_groups
from tests.equilibrium.specimens import fracture_test


@pytest.fixture(scope="module")
def two_strengths() -> Problem:
    """A beam with bonds far stronger than the others, which stay whole: the aggregate."""
    problem = fracture_test(radius=2 * MM)
    law, strong = problem.law, np.random.default_rng(3).random(problem.bonds.count) < 0.1
    f_max = np.where(strong, 20 * law.f_max, law.f_max)
    return replace(
        problem,
        law=LinearSoftening(law.k_n, f_max, np.where(strong, 20 * law.delta_max, law.delta_max)),
        cmod_max=0.2 * MM,
        stations=np.array([0.06, 0.15]) * MM,
    )


def weaker(problem: Problem, factor: float) -> Problem:
    """The same with the strength and opening of all but the strong bonds times `factor`."""
    law = problem.law
    share = np.where(law.delta_max > 1.5 * law.delta_max.min(), 1.0, factor)
    return problem.with_law(LinearSoftening(law.k_n, share * law.f_max, share * law.delta_max))


def test_one_simulation_gives_another(two_strengths: Problem) -> None:
    lead, factor = two_strengths, 0.8
    leading = leading_problem(lead, [1.0, factor])
    found, target = solve(leading), weaker(lead, factor)
    spared, direct = member_solution(found, leading, target, factor), solve(target)
    assert spared is not None
    assert spared.cmod == pytest.approx(target.stations)
    size = np.abs(direct.displacement).max()
    # the two are followed in other increments, which two-phase beams feel up to 0.2 %
    assert spared.displacement == pytest.approx(direct.displacement, abs=2e-3 * size)
    at = target.stations
    assert spared.curve.load_at(at) == pytest.approx(direct.curve.load_at(at), rel=5e-3)


def test_where_strong_bonds_break_nothing_is_spared(two_strengths: Problem) -> None:
    lead, factor = two_strengths, 0.8
    leading = leading_problem(lead, [1.0, factor])
    found = solve(leading)
    torn = replace(found, reached=np.where(lead.law.f_max > 1.5 * lead.law.f_max.min(), 1e-3, found.reached))
    assert member_solution(torn, leading, weaker(lead, factor), factor) is None


def test_a_short_solution_is_not_used(two_strengths: Problem) -> None:
    lead, factor = two_strengths, 0.8
    assert member_solution(solve(lead), lead, weaker(lead, factor), factor) is None


def test_a_square_grid_spares_its_diagonal() -> None:
    """5 × 5 nodes at 0.8 … 1.2: the five of equal ratio are one simulation, and no others."""
    nodes = [(f, d) for f in np.linspace(0.8, 1.2, 5) for d in np.linspace(0.8, 1.2, 5)]
    groups = scaling_groups(nodes)
    assert len(groups) == 21
    diagonal = max(groups, key=len)
    assert sorted(factor for _, factor in diagonal) == pytest.approx([0.8 / 1.2, 0.9 / 1.2, 1 / 1.2, 1.1 / 1.2, 1])


class _Counting(Silent):
    """Remembers what was simulated."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def done(self, name: str) -> None:
        self.names.append(name)


def identified(folder: Path, setting: str, grid: tuple[float, ...]) -> tuple[dict[str, Any], list[str]]:
    """The result of a bundle of known truth under a setting, and the names of what was simulated for it."""
    bundle, how, told = make_bundle(folder / "bundle"), folder / "settings.toml", _Counting()
    how.write_text(f"{setting}\nplacement_count = 0\nrecentring_count = 0\n", "utf-8")
    fixed: dict[str, Any] = {"engine": "equilibrium", "objective": "both", "workers": 1}
    identify(bundle, folder / "out", grid=grid, config=how, progress=told, **fixed)
    result = json.loads((folder / "out" / "result.json").read_text("utf-8"))
    assert result["f_max_n"] == pytest.approx(F_MAX, rel=0.03)  # the bundle's noise alone gives 2 %
    assert result["delta_max_m"] == pytest.approx(DELTA_MAX, rel=0.04)  # as much
    return result, told.names


def test_an_identification_by_the_scaling_law_needs_fewer_simulations(tmp_path: Path) -> None:
    _, names = identified(tmp_path, "scaling = true", (0.9, 1.0, 1.1))
    assert len(names) == 8  # 9 nodes, three of one ratio, and the optimum
    assert any("for 3 nodes of this ratio" in name for name in names)


def test_finite_kinematics_do_not_scale(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "bundle")
    edit(bundle, kinematics='"finite"')
    how = tmp_path / "scaling.toml"
    how.write_text("scaling = true\n", "utf-8")
    with pytest.raises(InputError, match="leave `scaling` and `ratio_count` out"):
        identify(bundle, tmp_path / "out", config=how)
    assert not list((tmp_path / "out").glob("simulations/*"))


def test_a_few_ratios_stand_for_the_grid(two_strengths: Problem) -> None:
    """Interpolated nodes against their own simulation, and the error that leaving out states."""
    nodes = [(f, d) for f in (0.9, 1.0, 1.1) for d in (0.9, 1.0, 1.1)]
    law = two_strengths.law
    weak = law.f_max < 1.5 * law.f_max.min()

    def problem_at(f: float, d: float) -> Problem:
        shares = np.where(weak, f, 1.0), np.where(weak, d, 1.0)
        return two_strengths.with_law(LinearSoftening(law.k_n, shares[0] * law.f_max, shares[1] * law.delta_max))

    simulated = []

    def solved(problems: list[tuple[str, Problem]]) -> list[tuple[Problem, Solution]]:
        simulated.extend(problems)
        return [(problem, solve(problem)) for _, problem in problems]

    found = between(nodes, 4, problem_at, solved)
    assert len(simulated) == 4
    assert len(found.trials) == 2
    stated = max(curve_difference(guess.curve, true.curve, t.stations) for t, true, guess in found.trials)
    for problem, guess in found.runs[::3]:
        direct = solve(problem)
        assert guess is not None
        assert guess.cmod == pytest.approx(problem.stations)
        # half the distance: a quarter of the error where it is smooth, half of it where paths change
        apart = curve_difference(guess.curve, direct.curve, problem.stations)
        assert apart < max(stated, 5e-3)  # increments end elsewhere: 0.2 % to 0.5 %
        size = np.abs(direct.displacement).max()
        assert guess.displacement == pytest.approx(direct.displacement, abs=2e-2 * size)


def test_an_identification_between_ratios_says_how_far_it_errs(tmp_path: Path) -> None:
    result, names = identified(tmp_path, "ratio_count = 5", (0.8, 0.9, 1.0, 1.1, 1.2))
    assert len(names) == 6  # five ratios and the optimum
    assert any("left out in turn is missed by" in remark for remark in result["remarks"])
