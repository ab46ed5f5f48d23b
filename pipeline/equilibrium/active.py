"""Which bonds are followed through the law from the start: a strip around the ligament."""

from __future__ import annotations

import numpy as np

from pipeline.core.problem import Kinematics, Problem
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.mixed_softening import MixedSoftening

STRIP = 0.2  # half width of the strip over the ligament; also how far it begins behind the tip
LARGEST = 0.5  # share of active bonds from which condensing does not pay
FEWEST = 2000  # particles below which it does not pay either


def strip(problem: Problem, share: float = STRIP) -> np.ndarray:
    """Bonds (m,) bool around the ligament, as far as `share` of it to either side."""
    middle = problem.particles.position[problem.bonds.pairs].mean(axis=1)
    half = share * problem.specimen.ligament_length
    return (np.abs(middle[:, 0]) <= half) & (middle[:, 1] >= problem.specimen.tip[1] - half)


def pays(problem: Problem, active: np.ndarray) -> bool:
    """Whether condensing is possible and worth its set-up."""
    linear = problem.kinematics == Kinematics.SMALL and isinstance(problem.law, CentralSoftening | MixedSoftening)
    return linear and problem.particles.count >= FEWEST and bool(np.mean(active) <= LARGEST)
