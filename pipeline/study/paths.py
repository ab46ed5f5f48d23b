"""The path of equilibria that an explicit run is judged by: where a specimen has several, the nearest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.problem import BondLaw, Solution
from pipeline.study.agreement import curve_difference, field_difference
from pipeline.study.observation import observe_solution
from pipeline.study.specimens import Trial

NEARLY = 1e-3  # by how much strengths are changed at most: their mean, and so the load, by far less
OTHERS = 6  # specimens of nearly the same strengths


@dataclass(frozen=True)
class Nearest:
    """How far a solution is from the nearest path.

    Parameters
    ----------
    curve, field : float, relative
    path : int; 0: of the specimen as it is, from 1 on: of one of nearly the same strengths
    limit : Solution on that path
    """

    curve: float
    field: float
    path: int
    limit: Solution

    @property
    def worst(self) -> float:
        """The larger difference; NaN where one could not be told."""
        return float(np.max([self.curve, self.field]))


def nearest_path(trial: Trial, solution: Solution, enough: float, solve: Callable[[Trial], Solution]) -> Nearest:
    """The nearest of several paths, each a sequence of equilibria; the first that is near `enough` is taken.

    Where two groups of bonds may soften and either relieves the other, equilibria go on with one or the other, and
    increments, tolerances or round-off choose. A real specimen chooses by its imperfections: so do those of nearly
    the same strengths, changed at random by `NEARLY` at most.

    Parameters
    ----------
    trial : Trial
    solution : Solution that is judged
    enough : float; largest difference of curve and field
    solve : the reference
    """
    found: list[Nearest] = []
    for path in range(OTHERS + 1):
        limit = solve(trial if path == 0 else nearly(trial, path))
        found.append(Nearest(*apart(trial, solution, limit), path, limit))
        if found[-1].worst <= enough:
            break
    return min(found, key=lambda near: near.worst if np.isfinite(near.worst) else np.inf)


def nearly(trial: Trial, seed: int) -> Trial:
    """The same test of a specimen with strengths changed at random."""
    law = _with_strengths(trial.problem.law, np.random.default_rng(seed))
    return Trial(f"{trial.name}, strengths {seed}", trial.problem.with_law(law), trial.points)


def _with_strengths(law: BondLaw, random: np.random.Generator) -> BondLaw:
    changed = law.f_max * (1 + NEARLY * random.uniform(-1, 1, law.f_max.size))
    return replace(law, f_max=changed)  # type: ignore[type-var]  # all laws are dataclasses


def apart(trial: Trial, solution: Solution, limit: Solution) -> tuple[float, float]:
    """Differences of curve and field, relative.

    Both fields are read over the particles that hang together in the limit. A point on a fragment leaps by as much as
    the fragment has moved when it parts, and the two need not reach that moment at the same station.
    """
    curve = curve_difference(solution.curve, limit.curve, trial.problem.stations)
    if len(solution.displacement) != len(limit.displacement):
        return curve, float("nan")
    seen = [observe_solution(trial.problem, s, trial.points, flanks_of=limit) for s in (solution, limit)]
    return curve, field_difference(*seen)
