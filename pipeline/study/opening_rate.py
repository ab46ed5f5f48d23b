"""Tests whose bonds are as strong as the rate at which they open makes them: simulated until rate and strength agree.

A bond's rate over the mouth's is dδ/dCMOD: no time enters. It changes little with the strengths, so that simulating
with the strengths of the last simulation's rates comes to rest after two or three. What is waited for is that strengths
agree with rates, not that loads do: those of a lattice differ by a hundredth of the peak where a bond snaps now here,
now there, which is what all its simulations are uncertain by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.core.errors import ConvergenceError
from pipeline.core.problem import Kinematics, Problem, Solution
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.rate_softening import RateSoftening

Solve = Callable[[Problem], Solution]

LOOKS = 80  # at the openings of a test, evenly spaced: as many as the longest increments of the equilibria, or half
AGREE = 5e-3  # of strength: root mean square, by energy, by which strengths may differ from those of their rates
BEAR = 3e-2  # the same after the last simulation
ROUNDS = 6  # simulations at most
NEIGHBOURS = 32  # softened bonds whose rate is that of the crack so far from the tip


def solve_at_rates(problem: Problem, solve: Solve) -> Solution:
    """The solution of any test; where the law depends on the rate of opening, by simulating it several times.

    From the third simulation on strengths go half the way to those of the rates of the last one.

    Parameters
    ----------
    problem : Problem
    solve : engine, Problem → Solution

    Raises
    ------
    ConvergenceError
        where rates and strengths do not come to agree
    """
    law = problem.law
    if not isinstance(law, RateSoftening):
        return solve(problem)
    looks = np.linspace(0.0, problem.cmod_max, LOOKS + 1)[1:]
    closer = replace(problem, stations=np.union1d(problem.stations, looks)).with_law(law.law)
    decades, seconds = np.zeros(law.k_n.size), 0.0
    for count in range(ROUNDS):
        now = closer.with_law(law.at(decades))
        found = solve(now)
        seconds += found.seconds
        measured = decades_of(now, found)
        off = law.per_decade * _apart(now, found, measured - decades)
        if count and off <= AGREE:  # the first knows nothing of rates
            break
        decades = 0.5 * (decades + measured) if count else measured
    if off > BEAR:
        raise ConvergenceError(
            f"strengths and rates of opening do not agree after {ROUNDS} simulations: strengths are off by {off:.1%}; "
            "take a smaller rate_law_per_decade"
        )
    return _at_stations(problem, found, seconds, f"known to {off:.2%} after simulation {count + 1}")


def decades_of(problem: Problem, solution: Solution) -> np.ndarray:
    """Decades (m,) by which the crack opened faster than the mouth where the bonds are, while it softened them.

    Of each softened bond the mean of log₁₀(dδ/dCMOD), each part of its softening counted by the energy that it used
    up: so one strength for the whole branch uses up what the rate of every moment would. Of these the mean over the
    softened bonds about as far from the notch tip, for the halves of a specimen turn, and open alike there wherever the
    crack runs; by nearness, energy and how much of their branch they spent, for a crack is wider than a bond, and one
    that softened a little, slowly, must not become the weakest. So bonds beside a crack, and those ahead of it at the
    end of the test, are as strong as those that it breaks, and do not draw it because their own rate is unknown.
    """
    law = problem.law
    assert isinstance(law, CentralSoftening)
    rise, work = _history(problem, solution)
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.where(work > 0, np.log10(rise / np.diff(solution.cmod, prepend=0.0)[:, None]), 0.0)
    spent = work.sum(axis=0)
    softened = np.flatnonzero(spent > 0)
    if not softened.size:
        return np.zeros(spent.size)
    own = np.sum(rate * work, axis=0)[softened] / spent[softened]
    return _around(problem, softened, own, spent[softened] ** 2 / law.dissipated(law.delta_end)[softened])


def _history(problem: Problem, solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """How far (frames, m), m, the largest opening of each bond rose up to each frame, and what that used up, J."""
    law = problem.law
    reached = np.maximum.accumulate(np.maximum(openings(problem, solution.displacement), 0.0), axis=0)
    free = np.isfinite(law.f_max)
    used = np.array([np.where(free, law.dissipated(np.where(free, row, 0.0)), 0.0) for row in reached])
    return np.diff(reached, axis=0, prepend=0.0), np.diff(used, axis=0, prepend=0.0)


def openings(problem: Problem, displacement: np.ndarray) -> np.ndarray:
    """Normal openings (frames, m), m, of bonds under displacements (frames, n, 2), m."""
    one, two = problem.bonds.pairs.T
    relative = displacement[:, two] - displacement[:, one]
    length, direction = problem.bonds.reference(problem.particles.position)
    if problem.kinematics is Kinematics.SMALL:
        return np.einsum("fmk,mk->fm", relative, direction)
    return np.linalg.norm(length[:, None] * direction + relative, axis=2) - length


def _around(problem: Problem, softened: np.ndarray, own: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Mean (m,) of what softened bonds (k,) int about as far from the tip have of their own (k,), by `counts` (k,)."""
    middle = problem.particles.position[problem.bonds.pairs].mean(axis=1)
    count = min(NEIGHBOURS, softened.size)
    away = np.hypot(*(middle - problem.specimen.tip).T)[:, None]
    far, near = cKDTree(away[softened]).query(away, k=np.arange(1, count + 1))
    weight = counts[near] / (far**2 + (2 * problem.particles.radius) ** 2)
    return np.sum(weight * own[near], axis=1) / weight.sum(axis=1)


def _apart(problem: Problem, found: Solution, change: np.ndarray) -> float:
    """Root mean square of the changes of bonds (m,), by the energy that they used up; 0 where none did."""
    free = np.isfinite(problem.law.f_max)
    spent = np.where(free, problem.law.dissipated(np.where(free, found.reached, 0.0)), 0.0)
    return float(np.sqrt(spent @ change**2 / spent.sum())) if spent.any() else 0.0


def _at_stations(problem: Problem, found: Solution, seconds: float, told: str) -> Solution:
    """The last solution with the frames that were asked for."""
    wanted = np.isin(found.cmod, problem.stations)
    return replace(
        found,
        cmod=found.cmod[wanted],
        displacement=found.displacement[wanted],
        seconds=seconds,
        message=f"{found.message}; strengths at their rates of opening {told}",
    )
