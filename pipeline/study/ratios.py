"""A grid of nodes from a few simulations, one for each of some ratios delta_max/f_max.

By the scaling law of small kinematics a test depends on f_max and delta_max through their ratio but for a factor.
Between two ratios displacements and loads are interpolated straight in the logarithm of the ratio. How far that errs
is seen by leaving each simulation out in turn and interpolating across it, over twice the distance. Neighbouring
simulations have different strengths, so that this tries the scaling as well: it is exact only where all strengths
follow f_max, or what does not follow takes no damage.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import EnergyBalance, Problem, Solution
from pipeline.study.scaling import at_stations_of, leading_problem, neighbour_solution

Node = tuple[float, float]
ProblemAt = Callable[[float, float], Problem]
Solved = Callable[[list[tuple[str, Problem]]], list[tuple[Problem, Solution]]]


@dataclass(frozen=True)
class Lead:
    """One simulation from which nodes of neighbouring ratios follow.

    Parameters
    ----------
    node : (f_max in N, delta_max in m)
    problem : Problem; followed far enough for all that use it
    solution : Solution
    """

    node: Node
    problem: Problem
    solution: Solution

    def scaled_to(self, f_max: float, target: Problem) -> Solution | None:
        """What it gives at another strength (N), with the frames of `target`; None where that is not exact."""
        return neighbour_solution(self.solution, self.problem, target, f_max / self.node[0])


@dataclass(frozen=True)
class Between:
    """A grid by interpolation in the ratio.

    Parameters
    ----------
    runs : problem and solution of every node; the solution None where it cannot be had so: simulate that node
    trials : what each inner simulation shows, and what its neighbours give for it
    """

    runs: list[tuple[Problem, Solution | None]]
    trials: list[tuple[Problem, Solution, Solution]]


def between(nodes: Sequence[Node], count: int, problem_at: ProblemAt, solved: Solved) -> Between:
    """Nodes of a grid from `count` simulations, their ratios equally spaced in the logarithm.

    Parameters
    ----------
    nodes : (f_max in N, delta_max in m)
    count : int, at least 3
    problem_at : f_max, delta_max → the test
    solved : named problems → with their solutions

    Raises
    ------
    InputError
        where solutions cannot be scaled
    """
    ratio = np.log([delta / f for f, delta in nodes])
    place = np.linspace(ratio.min(), ratio.max(), count)
    strength = np.array([f for f, _ in nodes])
    two = np.exp(np.quantile(np.log(strength), [0.25, 0.75]))
    chosen = [(float(two[k % 2]), float(np.exp(x) * two[k % 2])) for k, x in enumerate(place)]
    problems = []
    for k, node in enumerate(chosen):
        users = np.abs(ratio - place[k]) < 1.01 * (place[1] - place[0])
        factors = [1.0, *(two / node[0]), *(strength[users] / node[0])]
        problems.append((f"ratio {k + 1} of {count}", leading_problem(problem_at(*node), factors)))
    leads = [Lead(node, *run) for node, run in zip(chosen, solved(problems), strict=True)]
    runs = []
    for node, at in zip(nodes, ratio, strict=True):
        k = int(np.clip(np.searchsorted(place, at) - 1, 0, count - 2))
        target = problem_at(*node)
        runs.append((target, _mixed(leads[k], leads[k + 1], _share(place, k, at), node[0], target)))
    return Between(runs, list(_trials(leads, problem_at)))


def _trials(leads: list[Lead], problem_at: ProblemAt) -> list[tuple[Problem, Solution, Solution]]:
    found = []
    for before, lead, after in zip(leads, leads[1:], leads[2:], strict=False):
        target = problem_at(*lead.node)
        true, guess = at_stations_of(lead.solution, target), _mixed(before, after, 0.5, lead.node[0], target)
        if true is not None and guess is not None:
            found.append((target, true, guess))
    return found


def _share(place: np.ndarray, k: int, at: float) -> float:
    return float((at - place[k]) / (place[k + 1] - place[k]))


def _mixed(before: Lead, after: Lead, share: float, f_max: float, target: Problem) -> Solution | None:
    """Between two scaled simulations: (1 − share) of the first, share of the second."""
    a, b = before.scaled_to(f_max, target), after.scaled_to(f_max, target)
    if a is None or b is None:
        return None
    energy = {n: (1 - share) * v + share * getattr(b.energy, n) for n, v in vars(a.energy).items()}
    return replace(
        a,
        curve=_mixed_curve(a.curve, b.curve, share, target.cmod_rate),
        displacement=(1 - share) * a.displacement + share * b.displacement,
        reached=(1 - share) * a.reached + share * b.reached,
        energy=EnergyBalance(**energy),
        quasi_static_error=max(a.quasi_static_error, b.quasi_static_error),
        converged=a.converged and b.converged,
        message=f"between two ratios; {a.message}",
    )


def _mixed_curve(one: LoadCurve, other: LoadCurve, share: float, cmod_rate: float) -> LoadCurve:
    """Loads at equal CMOD, when each first reaches it."""
    cmod = np.unique(np.maximum.accumulate(one.cmod))
    cmod = cmod[(cmod >= other.cmod[0]) & (cmod <= other.cmod.max())]
    load = (1 - share) * one.load_at(cmod) + share * other.load_at(cmod)
    line = None
    if one.load_line is not None and other.load_line is not None:
        a, b = LoadCurve(one.time, one.cmod, one.load_line), LoadCurve(other.time, other.cmod, other.load_line)
        line = (1 - share) * a.load_at(cmod) + share * b.load_at(cmod)
    return LoadCurve(cmod / cmod_rate, cmod, load, line)
