"""How fast to load: a rule from the lowest mode, the geometry and the accuracy asked for.

The damping is relative to a running mean of the velocity, so a mode that drifts steadily feels no drag and
the error of the load is of second order in the rate (measured). Two numbers follow:

- the *highest rate*: at 1 % the undamaged specimen would be opened to the end of the test within
  `PERIODS` periods of its lowest mode; for other accuracies the rate goes with their square root;
- the *lag wanted*: fix cohesive/drive measures which share of the machine's power, at peak load, goes into
  motion and drag. Over the way of the machine that is a force by which the load is off; the rule keeps its root
  mean square over CMOD below `LAG` times the accuracy times that of the load. Over the
  stations the load was off by up to 1/`LAG` times that on ten specimens, by 0.33 to 2.43 times on four others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.problem import Problem, SlidingLaw
from pipeline.explicit.modes import Modes

PERIODS = 40
LAG = 1 / 2.25
SLOWEST = 1 / 300  # of the highest rate; below it a run would not end
LONGEST = 4000  # periods of the lowest mode until a run is given up
RECORD = 20  # steps between two records, a fiftieth of a period or less


@dataclass(frozen=True)
class Loading:
    """What fix cohesive/drive is told; the unit of time is the step.

    Parameters
    ----------
    first_rate, lowest_rate, highest_rate : float, m per step; speed of the machine
    lag : float; share of the root mean square load that may go into motion and drag
    first_load : float, N; load at first damage, stands for the peak load before it is known
    record : int; steps between two records
    steps_max : int; the run is given up after these
    """

    first_rate: float
    lowest_rate: float
    highest_rate: float
    lag: float
    first_load: float
    record: int
    steps_max: int


def loading_rule(problem: Problem, modes: Modes) -> Loading:
    """Choose the loading of a problem from its lowest mode and the accuracy asked for."""
    period = 2 * np.pi / modes.omega
    line = problem.cmod_max / modes.cmod
    highest = line / (PERIODS * period) * np.sqrt(problem.accuracy / 0.01)
    return Loading(
        first_rate=highest,
        lowest_rate=SLOWEST * highest,
        highest_rate=highest,
        lag=LAG * problem.accuracy,
        first_load=first_damage_load(problem, modes),
        record=RECORD,
        steps_max=int(LONGEST * period),
    )


def first_damage_load(problem: Problem, modes: Modes) -> float:
    """Load (N) at which the first bond reaches its strength."""
    first, second = problem.bonds.pairs.T
    length, direction = problem.bonds.reference(problem.particles.position)
    moved = modes.response[second] - modes.response[first]
    usage = np.maximum(np.sum(moved * direction, axis=1), 0.0) / problem.law.delta_peak
    if isinstance(problem.law, SlidingLaw):
        across = moved[:, 1] * direction[:, 0] - moved[:, 0] * direction[:, 1]
        sliding = across - length / 2 * (modes.rotation[first] + modes.rotation[second])
        usage = np.hypot(usage, problem.law.k_s * sliding / problem.law.f_shear)
    return float(modes.stiffness / np.max(usage))
