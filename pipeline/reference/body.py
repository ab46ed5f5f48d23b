"""A problem as masses, bonds and grips: everything that stays as it is from step to step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.problem import Grip, Kinematics, Problem
from pipeline.explicit.modes import masses


@dataclass(frozen=True)
class Body:
    """What moves, with the step as unit of time.

    Parameters
    ----------
    problem : Problem
    mass : (n,) array, N per (m/step²); fictitious, every particle equally near the stability limit
    length : (m,) array, m; of the undeformed bonds
    direction : (m, 2) array; unit vectors from first to second particle, undeformed
    """

    problem: Problem
    mass: np.ndarray
    length: np.ndarray
    direction: np.ndarray

    @property
    def grips(self) -> tuple[Grip, ...]:
        return self.problem.grips

    def bonds_at(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Opening δ (m,), m, and direction e (m, 2) of every bond, for particles at `position` (n, 2), m.

        small: δ = e·(x_j − x_i) − r₀ with the undeformed e; finite: δ = |x_j − x_i| − r₀ along the present one.
        """
        first, second = self.problem.bonds.pairs.T
        arm = position[second] - position[first]
        if self.problem.kinematics is Kinematics.FINITE:
            distance = np.sqrt(np.sum(arm * arm, axis=1))
            return distance - self.length, arm / distance[:, None]
        return np.sum(self.direction * arm, axis=1) - self.length, self.direction

    def forces(self, tension: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Forces (n, 2), N, on the particles: each bond pulls its ends together, fᵢ = +t e, fⱼ = −t e."""
        first, second = self.problem.bonds.pairs.T
        pull, n = tension[:, None] * direction, self.problem.particles.count
        towards = [np.bincount(first, pull[:, k], n) - np.bincount(second, pull[:, k], n) for k in (0, 1)]
        return np.column_stack(towards)

    def gauge(self, position: np.ndarray) -> float:
        """Reading of the clip gauge, m, without its zero."""
        return self.problem.gauge.cmod(position)


def body_of(problem: Problem) -> Body:
    """Masses, lengths and directions of a problem."""
    return Body(problem, masses(problem), *problem.bonds.reference(problem.particles.position))
