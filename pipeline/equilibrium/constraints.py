"""Grips as linear constraints, eliminated exactly: u = T q + s b, with s the machine displacement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from pipeline.core.errors import InputError
from pipeline.core.problem import Grip


@dataclass(frozen=True)
class Constraints:
    """A change of variables under which every grip holds identically.

    Degree of freedom `per` · i + k is component k of particle i: two displacements and, where particles rotate, the way
    of their rims, radius times rotation, which no grip holds. One degree of freedom a grip depends on the others.

    Parameters
    ----------
    expand : (per n, q) sparse array T
    drive : (per n,) array b, per metre of machine displacement
    dependent : (c,) int array
    transfer : (c, c) array; turns internal forces at the dependent degrees of freedom into reactions
    per : int; degrees of freedom of a particle, 2 or 3
    """

    expand: sparse.csr_array
    drive: np.ndarray
    dependent: np.ndarray
    transfer: np.ndarray
    per: int = 2

    def moved(self, free: np.ndarray, machine: float) -> np.ndarray:
        """All degrees of freedom (n, per), m, of free variables (q,), m, and machine displacement, m."""
        return (self.expand @ free + machine * self.drive).reshape(-1, self.per)

    def displacement(self, free: np.ndarray, machine: float) -> np.ndarray:
        """Displacements (n, 2), m, of free variables (q,), m, and machine displacement, m."""
        return self.moved(free, machine)[:, :2]

    def restrict(self, moved: np.ndarray) -> np.ndarray:
        """Free variables (q,), m, of all degrees of freedom (n, per), m."""
        return moved.reshape(-1)[self._kept]

    @property
    def particles(self) -> np.ndarray:
        """The particle (q,) int that each free variable moves."""
        return self._kept // self.per

    @property
    def _kept(self) -> np.ndarray:
        """The degrees of freedom (q,) int that are the free variables."""
        return np.setdiff1d(np.arange(self.drive.size), self.dependent)

    def reactions(self, internal: np.ndarray) -> np.ndarray:
        """Forces (c,), N, of the grips along their directions, from internal forces (per n,), N.

        They are the Lagrange multipliers λ of f_int = Aᵀ λ, read at the dependent degrees of freedom.
        """
        return self.transfer @ internal[self.dependent]


def eliminate(grips: tuple[Grip, ...], particles: int, per: int = 2) -> Constraints:
    """Change of variables for Σ wᵢ d·uᵢ = drive × s of every grip.

    Parameters
    ----------
    grips : tuple of Grip; they may share particles as long as they are independent
    particles : int
    per : int; degrees of freedom of a particle

    Raises
    ------
    InputError
        if two grips prescribe the same motion
    """
    rows = sparse.vstack([_row(g, particles, per) for g in grips]).tocsr()
    touched = np.unique(rows.indices)
    dense = rows[:, touched].toarray()
    _, triangle, order = linalg.qr(dense, mode="economic", pivoting=True)
    strength = np.abs(np.diag(triangle))
    if strength.size < len(grips) or strength[-1] < 1e-9 * strength[0]:
        names = ", ".join(g.name for g in grips)
        raise InputError(f"the grips {names} prescribe the same motion twice: remove one of them")
    return _change(dense, touched, order[: len(grips)], grips, particles, per)


def _row(grip: Grip, particles: int, per: int) -> sparse.coo_array:
    """One constraint as a row (1, per n)."""
    index = np.asarray(grip.index)
    column = (per * index[:, None] + np.arange(2)).ravel()
    value = (grip.weight[:, None] * np.asarray(grip.direction, float)).ravel()
    used = value != 0
    return sparse.coo_array((value[used], (np.zeros(used.sum(), int), column[used])), shape=(1, per * particles))


def _change(
    dense: np.ndarray, touched: np.ndarray, pivot: np.ndarray, grips: tuple[Grip, ...], particles: int, per: int
) -> Constraints:
    """Solve the constraints for the pivot columns."""
    size = per * particles
    inverse = np.linalg.inv(dense[:, pivot])
    others = np.setdiff1d(np.arange(touched.size), pivot)
    block = -inverse @ dense[:, others]
    block[np.abs(block) < 1e-12 * np.abs(block).max(initial=1.0)] = 0.0  # round-off of orthogonal grips
    dependent = touched[pivot]
    free = np.setdiff1d(np.arange(size), dependent)
    place = np.full(size, -1)
    place[free] = np.arange(free.size)
    i, j = np.nonzero(block)
    row = np.concatenate([free, dependent[i]])
    column = np.concatenate([np.arange(free.size), place[touched[others[j]]]])
    value = np.concatenate([np.ones(free.size), block[i, j]])
    drive = np.zeros(size)
    drive[dependent] = inverse @ [g.drive for g in grips]
    expand = sparse.coo_array((value, (row, column)), shape=(size, free.size)).tocsr()
    return Constraints(expand, drive, dependent, inverse.T, per)
