"""A bond network in free variables: openings, internal forces and stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import sparse

from pipeline.core.problem import Kinematics, Problem
from pipeline.equilibrium.constraints import Constraints, eliminate
from pipeline.equilibrium.factor import Solve, rough_solve


class Network(Protocol):
    """Bonds as functions of the free variables q (q,), m, and the machine displacement s, m."""

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        """δ (m,), m, of the bonds of this network."""
        ...

    def pull(self, force: np.ndarray, free: np.ndarray, machine: float) -> tuple[np.ndarray, float]:
        """Internal forces (q,), N, on the free variables and on the machine, N, for bond forces (m,), N."""
        ...

    def stiffness(self, weight: np.ndarray, free: np.ndarray, machine: float) -> sparse.csc_array:
        """Stiffness (q, q), N/m, of bonds with stiffness `weight` (m,), N/m."""
        ...

    def measure(self, weight: np.ndarray, free: np.ndarray, machine: float) -> Solve:
        """Steps (q,), m, under forces (q,), N, by that stiffness, in single precision."""
        ...

    def energy(self, free: np.ndarray, machine: float) -> float:
        """Elastic energy, J, of what is condensed into the network; 0 where nothing is."""
        ...


@dataclass(frozen=True)
class SmallNetwork:
    """δ_n = n₀·(u_j − u_i), linear in the displacements: δ = C q + s β.

    Parameters
    ----------
    jacobian : (m, q) sparse array C, and its transpose
    drive : (m,) array β
    """

    jacobian: sparse.csr_array
    transpose: sparse.csr_array
    drive: np.ndarray

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        return self.jacobian @ free + machine * self.drive

    def pull(self, force: np.ndarray, free: np.ndarray, machine: float) -> tuple[np.ndarray, float]:
        return self.transpose @ force, float(self.drive @ force)

    def stiffness(self, weight: np.ndarray, free: np.ndarray, machine: float) -> sparse.csc_array:
        return (self.transpose @ (self.jacobian * weight[:, None])).tocsc()

    def measure(self, weight: np.ndarray, free: np.ndarray, machine: float) -> Solve:
        return rough_solve(self.stiffness(weight, free, machine))

    def energy(self, free: np.ndarray, machine: float) -> float:
        return 0.0

    def part(self, bonds: np.ndarray, variables: np.ndarray) -> SmallNetwork:
        """Some of the bonds, in some of the variables; no others may move them."""
        jacobian = self.jacobian[bonds][:, variables].tocsr()
        return SmallNetwork(jacobian, jacobian.T.tocsr(), self.drive[bonds])


@dataclass(frozen=True)
class FiniteNetwork:
    """δ_n = |x_j − x_i| − r₀ with the true positions: objective under any rotation.

    Parameters
    ----------
    arm : (m, 2) array, m; undeformed bond vectors
    pairs : (m, 2) int array
    constraints : Constraints
    """

    arm: np.ndarray
    pairs: np.ndarray
    constraints: Constraints

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        relative = self._relative(free, machine)
        gain = np.sum((2 * self.arm + relative) * relative, axis=1)
        return gain / (_norm(self.arm + relative) + _norm(self.arm))  # |a + r| − |a| without cancellation

    def pull(self, force: np.ndarray, free: np.ndarray, machine: float) -> tuple[np.ndarray, float]:
        vector = force[:, None] * self._direction(free, machine)
        size = self.constraints.drive.size
        column = 2 * self.pairs[:, :, None] + np.arange(2)
        nodal = np.bincount(column[:, 1].ravel(), vector.ravel(), size)
        nodal -= np.bincount(column[:, 0].ravel(), vector.ravel(), size)
        return self.constraints.expand.T @ nodal, float(self.constraints.drive @ nodal)

    def stiffness(self, weight: np.ndarray, free: np.ndarray, machine: float) -> sparse.csc_array:
        """Material part only: the geometric part, force over length, is about 1e-3 of it and may be negative."""
        jacobian, _ = _jacobian(self._direction(free, machine), self.pairs, self.constraints)
        return (jacobian.T @ (jacobian * weight[:, None])).tocsc()

    def measure(self, weight: np.ndarray, free: np.ndarray, machine: float) -> Solve:
        return rough_solve(self.stiffness(weight, free, machine))

    def energy(self, free: np.ndarray, machine: float) -> float:
        return 0.0

    def _relative(self, free: np.ndarray, machine: float) -> np.ndarray:
        moved = self.constraints.displacement(free, machine)
        return moved[self.pairs[:, 1]] - moved[self.pairs[:, 0]]

    def _direction(self, free: np.ndarray, machine: float) -> np.ndarray:
        now = self.arm + self._relative(free, machine)
        return now / _norm(now)[:, None]


def whole_network(problem: Problem) -> tuple[SmallNetwork | FiniteNetwork, Constraints]:
    """The bond network of a problem with its grips eliminated, and the change of variables."""
    constraints = eliminate(problem.grips, problem.particles.count)
    length, direction = problem.bonds.reference(problem.particles.position)
    pairs = problem.bonds.pairs.astype(np.int64)
    if problem.kinematics == Kinematics.FINITE:
        return FiniteNetwork(length[:, None] * direction, pairs, constraints), constraints
    jacobian, drive = _jacobian(direction, pairs, constraints)
    return SmallNetwork(jacobian, jacobian.T.tocsr(), drive), constraints


def _jacobian(
    direction: np.ndarray, pairs: np.ndarray, constraints: Constraints
) -> tuple[sparse.csr_array, np.ndarray]:
    """∂δ/∂q (m, q) and ∂δ/∂s (m,) for bond directions (m, 2)."""
    column = (2 * pairs[:, :, None] + np.arange(2)).reshape(-1)
    value = np.stack([-direction, direction], axis=1).reshape(-1)
    row = np.repeat(np.arange(len(pairs)), 4)
    full = sparse.coo_array((value, (row, column)), shape=(len(pairs), constraints.drive.size)).tocsr()
    return (full @ constraints.expand).tocsr(), full @ constraints.drive


def _norm(vector: np.ndarray) -> np.ndarray:
    return np.hypot(vector[:, 0], vector[:, 1])
