"""The scaling law of small kinematics: strengths and openings times s give s times the displacements at s × CMOD."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.problem import EnergyBalance, Kinematics, Problem, Solution
from pipeline.materials.cohesive import LinearSoftening


def scaled_law(law: LinearSoftening, factor: float) -> LinearSoftening:
    """(s f_max, s δ_max) of every bond."""
    return LinearSoftening(law.k_n, factor * law.f_max, factor * law.delta_max)


def scaled_problem(problem: Problem, factor: float) -> Problem:
    """The problem whose solution is that of `problem`, scaled.

    Raises
    ------
    InputError
        where the law of scaling does not hold
    """
    if problem.kinematics is not Kinematics.SMALL or not isinstance(problem.law, LinearSoftening):
        raise InputError("solutions are scaled under small kinematics and linear softening only")
    return replace(
        problem,
        law=scaled_law(problem.law, factor),
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
