"""Full fields of an explicit run, brought to the CMOD stations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.problem import Problem


@dataclass(frozen=True)
class Frame:
    """Positions (n, 2), m, and velocities (n, 2), m per step, of all particles at one step."""

    step: int
    position: np.ndarray
    velocity: np.ndarray


def fields_at_stations(problem: Problem, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
    """Displacements at the problem's stations, as far as they were reached.

    Each frame is moved along its own velocity back to the station that it was taken after.

    Returns
    -------
    stations (k,), m; displacement (k, n, 2), m
    """
    moved = [frame.position - problem.particles.position for frame in frames]
    opened = np.array([problem.gauge.cmod(field) for field in moved])
    reached = problem.stations[problem.stations <= opened.max(initial=-np.inf)]
    fields = []
    for station in reached:
        after = int(np.argmax(opened >= station))
        speed = problem.gauge.cmod(frames[after].velocity)
        late = (opened[after] - station) / speed if speed > 0 else 0.0
        fields.append(moved[after] - late * frames[after].velocity)
    return reached, np.array(fields).reshape(len(fields), -1, 2)
