"""How fast to load: a rule from the lowest mode, the geometry and the accuracy asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.problem import Problem
from pipeline.lmp.modes import Modes


@dataclass(frozen=True)
class Loading:
    """Machine speeds in m per step."""

    first_rate: float
    lowest_rate: float
    highest_rate: float
    lag: float
    first_load: float
    record: int
    steps_max: int


def loading_rule(problem: Problem, modes: Modes) -> Loading:
    period = 2 * np.pi / modes.omega
    line = problem.cmod_max / modes.cmod
    rate = line / (40 * period)* (problem.accuracy/0.01)**.5
    return Loading(rate, rate/100, rate, problem.accuracy, first_damage_load(problem, modes), 20, 10_000_000)


def first_damage_load(problem: Problem, modes: Modes) -> float:
    """Load (N) at which the first bond reaches its strength."""
    pairs = problem.bonds.pairs
    _, direction = problem.bonds.reference(problem.particles.position)
    opening = np.sum((modes.response[pairs[:, 1]] - modes.response[pairs[:, 0]]) * direction, axis=1)
    return float(modes.stiffness / np.max(opening / problem.law.delta_peak))
