"""A bond network in free variables: deformations, internal forces and stiffness.

The deformations of m bonds are their openings (m,); where bonds slide too, all openings and then all slidings (2m,):
forces and stiffnesses go in the same order. A particle that rotates has a third degree of freedom, its radius times
its rotation, so that all variables are in m and all their forces in N.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy import sparse

from pipeline.core.problem import Kinematics, Problem, SlidingLaw
from pipeline.equilibrium.assembly import Assembly, assembly
from pipeline.equilibrium.cholesky import Plan, available
from pipeline.equilibrium.constraints import Constraints, eliminate
from pipeline.equilibrium.dissection import dissected
from pipeline.equilibrium.factor import Solve, reordered, rough_solve


class Network(Protocol):
    """Bonds as functions of the free variables q (q,), m, and the machine displacement s, m."""

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        """δ_n (m,), m, of the bonds of this network, and δ_t (m,) behind them where these slide."""
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
    place : (q, 2) array, m; where the particles are that the variables move
    """

    jacobian: sparse.csr_array
    transpose: sparse.csr_array
    drive: np.ndarray
    place: np.ndarray

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        return self.jacobian @ free + machine * self.drive

    def pull(self, force: np.ndarray, free: np.ndarray, machine: float) -> tuple[np.ndarray, float]:
        return self.transpose @ force, float(self.drive @ force)

    def stiffness(self, weight: np.ndarray, free: np.ndarray, machine: float) -> sparse.csc_array:
        return (self.transpose @ (self.jacobian * weight[:, None])).tocsc()

    def measure(self, weight: np.ndarray, free: np.ndarray, machine: float) -> Solve:
        if not available():
            return rough_solve(self.stiffness(weight, free, machine))
        order, frame, plan = self._frame
        factor = plan.factor(frame.stiffness(weight, np.zeros((0, 0))), single=True)
        return reordered(factor.solve, order)

    def energy(self, free: np.ndarray, machine: float) -> float:
        return 0.0

    @cached_property
    def _frame(self) -> tuple[np.ndarray, Assembly, Plan]:
        """A good order of elimination (q,) of the variables; assembly and plan of the stiffness in that order."""
        order = dissected(abs(self.transpose) @ abs(self.jacobian), self.place)
        frame = assembly(self.jacobian[:, order].tocsr(), np.zeros(0, int))
        return order, frame, Plan(frame.stiffness(np.ones(self.drive.size), np.zeros((0, 0))))

    def part(self, bonds: np.ndarray, variables: np.ndarray) -> SmallNetwork:
        """Some of the bonds, in some of the variables; no others may move them."""
        jacobian = self.jacobian[bonds][:, variables].tocsr()
        return small_network(jacobian, self.drive[bonds], self.place[variables])


@dataclass(frozen=True)
class FiniteNetwork:
    """δ_n = |x_j − x_i| − r₀ with the true positions, δ_t = r₀ (φ − (θ_i + θ_j)/2), φ how far the bond has turned.

    Objective under any rotation of all particles.

    Parameters
    ----------
    length : (m,) array, m, and direction : (m, 2) array; of undeformed bonds
    pairs : (m, 2) int array
    constraints : Constraints
    lever : (m,) array, r₀/2 over the radius of the particles; None where bonds do not slide
    """

    length: np.ndarray
    direction: np.ndarray
    pairs: np.ndarray
    constraints: Constraints
    lever: np.ndarray | None = None

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        moved = self.constraints.moved(free, machine)
        relative = self._relative(moved)
        gain = np.sum((2 * self.length[:, None] * self.direction + relative) * relative, axis=1)
        along = self.length + np.sum(self.direction * relative, axis=1)
        across = self.direction[:, 0] * relative[:, 1] - self.direction[:, 1] * relative[:, 0]
        opening = gain / (np.hypot(along, across) + self.length)  # |a + r| − |a| without cancellation
        if self.lever is None:
            return opening
        ends = (moved[self.pairs[:, 0], 2] + moved[self.pairs[:, 1], 2]) * (self.lever / self.length)
        return np.append(opening, self.length * _least_turn(np.arctan2(across, along) - ends))

    def pull(self, force: np.ndarray, free: np.ndarray, machine: float) -> tuple[np.ndarray, float]:
        direction, rate = self._present(free, machine)
        tension, per, size = force[: len(self.pairs)], self.constraints.per, self.constraints.drive.size
        vector = tension[:, None] * direction
        if self.lever is not None:
            shear = force[len(self.pairs) :]
            vector += (shear * rate)[:, None] * _across(direction)
        column = per * self.pairs[:, :, None] + np.arange(2)
        nodal = np.bincount(column[:, 1].ravel(), vector.ravel(), size)
        nodal -= np.bincount(column[:, 0].ravel(), vector.ravel(), size)
        if self.lever is not None:
            nodal -= np.bincount((3 * self.pairs + 2).ravel(), np.repeat(self.lever * shear, 2), size)
        return self.constraints.expand.T @ nodal, float(self.constraints.drive @ nodal)

    def stiffness(self, weight: np.ndarray, free: np.ndarray, machine: float) -> sparse.csc_array:
        """Material part only: the geometric part, force over length, is about 1e-3 of it and may be negative."""
        direction, rate = self._present(free, machine)
        full = _jacobian(direction, self.pairs, self.constraints, self.lever, rate)
        jacobian = (full @ self.constraints.expand).tocsr()
        return (jacobian.T @ (jacobian * weight[:, None])).tocsc()

    def measure(self, weight: np.ndarray, free: np.ndarray, machine: float) -> Solve:
        return rough_solve(self.stiffness(weight, free, machine))

    def energy(self, free: np.ndarray, machine: float) -> float:
        return 0.0

    def _relative(self, moved: np.ndarray) -> np.ndarray:
        """u_j − u_i (m, 2), m, of degrees of freedom (n, per), m."""
        place = np.ascontiguousarray(moved[:, :2])
        return place[self.pairs[:, 1]] - place[self.pairs[:, 0]]

    def _present(self, free: np.ndarray, machine: float) -> tuple[np.ndarray, np.ndarray]:
        """Direction (m, 2) of bonds now, and their first length over that now (m,)."""
        now = self.length[:, None] * self.direction + self._relative(self.constraints.moved(free, machine))
        distance = np.hypot(now[:, 0], now[:, 1])
        return now / distance[:, None], self.length / distance


def small_network(jacobian: sparse.csr_array, drive: np.ndarray, place: np.ndarray) -> SmallNetwork:
    """The network with these openings a unit of its variables, and of the machine; 32-bit indices are read faster."""
    forth, back = (
        sparse.csr_array((m.data, m.indices.astype(np.int32), m.indptr.astype(np.int32)), shape=m.shape)
        for m in (jacobian, jacobian.T.tocsr())
    )
    return SmallNetwork(forth, back, drive, place)


def whole_network(problem: Problem) -> tuple[SmallNetwork | FiniteNetwork, Constraints]:
    """The bond network of a problem with its grips eliminated, and the change of variables."""
    slides = isinstance(problem.law, SlidingLaw)
    constraints = eliminate(problem.grips, problem.particles.count, 3 if slides else 2)
    length, direction = problem.bonds.reference(problem.particles.position)
    pairs = problem.bonds.pairs.astype(np.int64)
    lever = length / (2 * problem.particles.radius) if slides else None
    if problem.kinematics == Kinematics.FINITE:
        return FiniteNetwork(length, direction, pairs, constraints, lever), constraints
    full = _jacobian(direction, pairs, constraints, lever)
    jacobian = (full @ constraints.expand).tocsr()
    place = problem.particles.position[constraints.particles]
    return small_network(jacobian, full @ constraints.drive, place), constraints


def _jacobian(
    direction: np.ndarray,
    pairs: np.ndarray,
    constraints: Constraints,
    lever: np.ndarray | None,
    rate: np.ndarray | None = None,
) -> sparse.csr_array:
    """What bonds along `direction` (m, 2) are deformed by a unit of every degree of freedom.

    They slide by `rate` (m,) for a unit across them, 1 if there is none, and by −`lever` (m,) for a unit of their ends'
    rotation.
    """
    parts = [np.hstack([-direction, direction])]
    if lever is not None:
        turn, across = -lever[:, None], _across(direction) if rate is None else rate[:, None] * _across(direction)
        none = np.zeros_like(turn)
        parts = [np.hstack([-direction, none, direction, none]), np.hstack([-across, turn, across, turn])]
    value, per, size = np.vstack(parts), constraints.per, constraints.drive.size
    column = (per * pairs[:, :, None] + np.arange(per)).reshape(len(pairs), -1)
    start = np.arange(0, value.size + 1, 2 * per)
    return sparse.csr_array((value.ravel(), np.tile(column, (len(parts), 1)).ravel(), start), shape=(len(value), size))


def _across(direction: np.ndarray) -> np.ndarray:
    """Directions (m, 2) turned by a right angle."""
    return np.column_stack([-direction[:, 1], direction[:, 0]])


def _least_turn(angle: np.ndarray) -> np.ndarray:
    """The same turn (m,), rad, less whole ones: between −π and π."""
    return np.where(np.abs(angle) < np.pi, angle, angle - 2 * np.pi * np.rint(angle / (2 * np.pi)))
