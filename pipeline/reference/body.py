"""A problem as masses, bonds and grips: everything that stays as it is from step to step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.problem import Grip, Kinematics, Problem
from pipeline.explicit.modes import inertias, masses, shear_stiffness


@dataclass(frozen=True)
class Pull:
    """How forces of bonds act: along `direction` (m, 2), across it times `lever` (m,), and by `arm` (m,), m."""

    direction: np.ndarray
    lever: np.ndarray
    arm: np.ndarray


@dataclass(frozen=True)
class Body:
    """What moves, with the step as unit of time.

    Parameters
    ----------
    problem : Problem
    mass : (n,) array, N per (m/step²); fictitious, every particle equally near the stability limit
    inertia : (n,) array, N m per (rad/step²); the same for rotations, 0 where particles do not rotate
    length : (m,) array, m; of the undeformed bonds
    direction : (m, 2) array; unit vectors from first to second particle, undeformed
    """

    problem: Problem
    mass: np.ndarray
    inertia: np.ndarray
    length: np.ndarray
    direction: np.ndarray

    @property
    def grips(self) -> tuple[Grip, ...]:
        return self.problem.grips

    @property
    def rotates(self) -> bool:
        """Whether the bonds slide, and so turn their particles."""
        return shear_stiffness(self.problem) is not None

    def bonds_at(self, position: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, Pull]:
        """Opening and sliding (m,), m, of every bond, for particles at `position` (n, 2), m, turned by `angle` (n,).

        small: δ_n = e·(x_j − x_i) − r₀ with the undeformed e, δ_t = s·(x_j − x_i) − r (θ_i + θ_j), s across e;
        finite: δ_n = |x_j − x_i| − r₀ along the present one, δ_t = r₀ (φ − (θ_i + θ_j)/2), φ how far the bond turned.
        """
        first, second = self.problem.bonds.pairs.T
        arm, ends = position[second] - position[first], angle[first] + angle[second]
        cross = self.direction[:, 0] * arm[:, 1] - self.direction[:, 1] * arm[:, 0]
        along = np.sum(self.direction * arm, axis=1)
        half, one = self.length / 2, np.ones_like(self.length)
        if self.problem.kinematics is Kinematics.SMALL:
            return along - self.length, cross - half * ends, Pull(self.direction, one, half)
        distance = np.sqrt(np.sum(arm * arm, axis=1))
        more = np.arctan2(cross, along) - ends / 2
        turned = np.where(np.abs(more) < np.pi, more, more - 2 * np.pi * np.rint(more / (2 * np.pi)))
        pull = Pull(arm / distance[:, None], self.length / distance, half)
        return distance - self.length, self.length * turned, pull

    def forces(self, tension: np.ndarray, shear: np.ndarray, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
        """Forces (n, 2), N, and torques (n,), N m: bonds pull their ends together, and slide and turn them back."""
        first, second = self.problem.bonds.pairs.T
        across = np.column_stack([-pull.direction[:, 1], pull.direction[:, 0]])
        force, n = tension[:, None] * pull.direction, self.problem.particles.count
        if self.rotates:
            force = force + (shear * pull.lever)[:, None] * across
        towards = [np.bincount(first, force[:, k], n) - np.bincount(second, force[:, k], n) for k in (0, 1)]
        twist = pull.arm * shear
        return np.column_stack(towards), np.bincount(first, twist, n) + np.bincount(second, twist, n)

    def gauge(self, position: np.ndarray) -> float:
        """Reading of the clip gauge, m, without its zero."""
        return self.problem.gauge.cmod(position)


def body_of(problem: Problem) -> Body:
    """Masses, lengths and directions of a problem."""
    return Body(problem, masses(problem), inertias(problem), *problem.bonds.reference(problem.particles.position))
