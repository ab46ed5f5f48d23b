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
    record: int
    steps_max: int


def loading_rule(problem: Problem, modes: Modes) -> Loading:
    period = 2 * np.pi / modes.omega
    line = problem.cmod_max / modes.cmod
    rate = line / (20 * period)
    return Loading(rate, rate, rate, problem.accuracy, 20, 10_000_000)
