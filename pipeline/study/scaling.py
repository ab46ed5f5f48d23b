"""The scaling law of small kinematics: strengths and openings times s give s times the displacements at s × CMOD."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.problem import BondLaw, EnergyBalance, Kinematics, Problem, Solution
from pipeline.materials.cohesive import CentralSoftening

FEW = 0.05  # of the softened bonds may be of an aggregate that keeps its strength, where solutions are interpolated


def scaled_problem(problem: Problem, factor: float) -> Problem:
    """The problem whose solution is that of `problem`, scaled.

    Raises
    ------
    InputError
        where the law of scaling does not hold
    """
    law = _scalable(problem)
    return replace(
        problem,
        law=law.scaled(factor),
        cmod_max=factor * problem.cmod_max,
        stations=factor * problem.stations,
    )


def scaled_solution(solution: Solution, problem: Problem, factor: float) -> Solution:
    """The solution of `scaled_problem(problem, factor)` from that of `problem`, with no simulation."""
    curve, energy = solution.curve, solution.energy
    load_line = None if curve.load_line is None else factor * curve.load_line
    cmod = factor * curve.cmod
    time = np.maximum.accumulate(cmod) / problem.cmod_rate
    return replace(
        solution,
        curve=LoadCurve(time, cmod, factor * curve.load, load_line),
        cmod=factor * solution.cmod,
        displacement=factor * solution.displacement,
        reached=factor * solution.reached,
        energy=EnergyBalance(**{name: factor**2 * value for name, value in vars(energy).items()}),
        message=f"{solution.message}; scaled by {factor:g}",
    )


def scaling_groups(nodes: list[tuple[float, float]]) -> list[list[tuple[int, float]]]:
    """Nodes (f_max, delta_max) of a grid that one simulation would give, the largest of each group first.

    Nodes whose delta_max/f_max is the same map on each other, if every strength and opening is scaled
    (`aggregate_follows`, or no damage in the aggregate): the largest would have to be followed to a CMOD
    larger by 1/factor.

    Returns
    -------
    groups of (number of the node, factor to the first of its group)
    """
    ratios = np.array([delta / f for f, delta in nodes])
    groups: dict[float, list[int]] = {}
    for number, ratio in enumerate(ratios):
        known = next((r for r in groups if np.isclose(r, ratio, rtol=1e-9, atol=0)), float(ratio))
        groups.setdefault(known, []).append(number)
    ordered = [sorted(group, key=lambda k: -nodes[k][0]) for group in groups.values()]
    return [[(k, nodes[k][0] / nodes[group[0]][0]) for k in group] for group in ordered]


def leading_problem(problem: Problem, factors: list[float]) -> Problem:
    """The problem to simulate so that its scaled solutions reach the end and the stations of `problem`.

    Parameters
    ----------
    problem : Problem with the law of the group's first node
    factors : of all nodes of the group, from `scaling_groups`: the first is 1

    Raises
    ------
    InputError
        where the law of scaling does not hold
    """
    _scalable(problem)
    stations = np.unique(np.concatenate([problem.stations / factor for factor in factors]))
    distinct = np.append(True, np.diff(stations) > 1e-9 * stations[-1])
    return replace(problem, cmod_max=problem.cmod_max / min(factors), stations=stations[distinct])


def member_solution(lead: Solution, leading: Problem, target: Problem, factor: float) -> Solution | None:
    """The solution of `target` from that of `leading`, of strengths and openings 1/factor as large.

    Where bonds of the target do not follow the scaling (an aggregate that keeps its strength), the solution is
    exact all the same as long as none of them is damaged in either; that is looked at.

    Returns
    -------
    Solution up to the last CMOD of `target`, fields at its stations; None where it would not be exact, or too short
    """
    scaled = scaled_problem(leading, factor)
    solution = scaled_solution(lead, leading, factor)
    same = _untouched(scaled.law, target.law, solution.reached)
    return at_stations_of(solution, target) if same else None


def at_stations_of(solution: Solution, target: Problem) -> Solution | None:
    """A solution that was followed farther, with the frames of `target` alone; None where it is too short for it."""
    if solution.curve.cmod[-1] < 0.999 * target.cmod_max:
        return None
    frames = [int(np.argmin(np.abs(solution.cmod - station))) for station in target.stations]
    if not np.allclose(solution.cmod[frames], target.stations, rtol=1e-6, atol=0):
        return None
    return replace(solution, cmod=target.stations, displacement=solution.displacement[frames])


def neighbour_solution(lead: Solution, leading: Problem, target: Problem, factor: float) -> Solution | None:
    """As `member_solution`, for a target of the same strengths whose openings are not those of the scaled lead.

    Returns
    -------
    Solution of the scaled lead with the frames of `target`; None where it is too short, or where more than `FEW` of
    the bonds that softened have a strength that does not follow: a few such bonds err little
    """
    solution, law = scaled_solution(lead, leading, factor), scaled_problem(leading, factor).law
    if not (isinstance(law, CentralSoftening) and isinstance(target.law, CentralSoftening)):
        return None
    unlike = ~np.isclose(law.f_max, target.law.f_max, rtol=1e-9, atol=0)
    softened = solution.reached > np.minimum(law.delta_peak, target.law.delta_peak)
    if np.sum(softened & unlike) > FEW * np.sum(softened):
        return None
    return at_stations_of(solution, target)


def _scalable(problem: Problem) -> CentralSoftening:
    """The law of a problem whose solutions can be scaled."""
    if problem.kinematics is not Kinematics.SMALL or not isinstance(problem.law, CentralSoftening):
        raise InputError(
            "solutions are scaled only under small kinematics and for bonds that neither creep nor slide: "
            "leave `scaling` and `ratio_count` out"
        )
    return problem.law


def _untouched(scaled: BondLaw, target: BondLaw, reached: np.ndarray) -> bool:
    """Whether bonds (m,) whose law differs in both stayed elastic in both, having opened up to `reached` (m,), m."""
    if not isinstance(scaled, CentralSoftening) or not isinstance(target, CentralSoftening):
        return False
    if (scaled.softening, scaled.unloading) != (target.softening, target.unloading):
        return False
    if not np.allclose(scaled.k_n, target.k_n, rtol=1e-9, atol=0):
        return False
    pairs = ((scaled.f_max, target.f_max), (scaled.delta_max, target.delta_max))
    unlike = np.logical_or(*(~np.isclose(a, b, rtol=1e-9, atol=0) for a, b in pairs))
    unlike &= np.isfinite(scaled.f_max) | np.isfinite(target.f_max)
    weaker = np.minimum(scaled.delta_peak, target.delta_peak)
    return bool(np.all(reached[unlike] <= weaker[unlike]))
