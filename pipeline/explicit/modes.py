"""The undamaged specimen as explicit engines see it: masses, elastic response, lowest mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from pipeline.core.problem import Grip, Problem, Role

SAFETY = 0.9  # of the largest stable time step, as in fix_cohesive_drive.cpp


@dataclass(frozen=True)
class Modes:
    """What the loading rule needs to know, with the time step as unit of time.

    Parameters
    ----------
    omega : float, rad per step; lowest natural frequency with all grips held
    response : (n, 2) array; elastic displacement per unit machine displacement
    stiffness : float, N/m; load per unit machine displacement
    cmod : float; CMOD per unit machine displacement
    """

    omega: float
    response: np.ndarray
    stiffness: float
    cmod: float


def stiffness_matrix(problem: Problem) -> sparse.csc_matrix:
    """Undamaged stiffness (2n, 2n) in N/m, degrees of freedom ordered x₀ y₀ x₁ y₁ …"""
    pairs = problem.bonds.pairs
    _, direction = problem.bonds.reference(problem.particles.position)
    block = problem.law.k_n[:, None, None] * direction[:, :, None] * direction[:, None, :]
    dof = np.concatenate([2 * pairs[:, :1], 2 * pairs[:, :1] + 1, 2 * pairs[:, 1:], 2 * pairs[:, 1:] + 1], axis=1)
    element = np.block([[block, -block], [-block, block]])
    rows = np.repeat(dof, 4, axis=1).ravel()
    columns = np.tile(dof, (1, 4)).ravel()
    size = 2 * problem.particles.count
    return sparse.coo_matrix((element.ravel(), (rows, columns)), shape=(size, size)).tocsc()


def masses(problem: Problem) -> np.ndarray:
    """Fictitious masses (n,) in kg for a time step of 1 s: every particle is equally near instability.

    ω² ≤ 2 max λ(Σ k_n n⊗n)/m, from k (n·(u_j − u_i))² ≤ 2k (n·u_j)² + 2k (n·u_i)².
    """
    matrix = stiffness_matrix(problem)
    diagonal = matrix.diagonal()
    xx, yy = diagonal[0::2], diagonal[1::2]
    xy = matrix.diagonal(1)[0::2]
    largest = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    return largest / (2 * SAFETY**2)


def lowest_modes(problem: Problem) -> Modes:
    """Elastic response and lowest mode of the undamaged specimen, grips as stiff springs."""
    matrix = stiffness_matrix(problem)
    grips = [_row(problem, grip) for grip in problem.grips]
    # stiff enough to hold (1e-4 of the movement slips), soft enough to keep the factorisation exact
    spring = 1e4 * float(np.mean(problem.law.k_n))
    rows = sparse.csr_matrix(np.array(grips))
    held = (matrix + spring * (rows.T @ rows)).tocsc()
    factor = splu(held)
    drive = np.array([grip.drive for grip in problem.grips])
    response = factor.solve(np.asarray(rows.T @ (spring * drive)).ravel())
    mass = np.repeat(masses(problem), 2)
    inverse = LinearOperator(held.shape, matvec=factor.solve, dtype=float)
    # a fixed first vector: ARPACK's own is random, and a run must be repeatable to the bit
    options = {"sigma": 0.0, "OPinv": inverse, "return_eigenvectors": False, "tol": 1e-4, "v0": np.ones(mass.size)}
    lowest = eigsh(held, k=1, M=sparse.diags(mass).tocsc(), **options)
    field = response.reshape(-1, 2)
    slip = drive - rows @ response
    load = spring * sum(s for s, grip in zip(slip, problem.grips, strict=True) if grip.role is Role.DRIVE)
    return Modes(float(np.sqrt(lowest[0])), field, float(load), problem.gauge.cmod(field))


def _row(problem: Problem, grip: Grip) -> np.ndarray:
    row = np.zeros((problem.particles.count, 2))
    row[grip.index] = grip.weight[:, None] * grip.direction
    return row.ravel()
