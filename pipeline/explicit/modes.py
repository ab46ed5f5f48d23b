"""The undamaged specimen as explicit engines see it: masses, elastic response, lowest mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from pipeline.core.problem import Grip, Problem, Role, SlidingLaw

SAFETY = 0.9  # of the largest stable time step, as in fix_cohesive_drive.cpp
SLIDE, TURN = 1.25, 5.0  # (a + b)² ≤ SLIDE a² + TURN b²: sliding and turning of a bond's ends, as there


@dataclass(frozen=True)
class Modes:
    """What the loading rule needs to know, with the time step as unit of time.

    Parameters
    ----------
    omega : float, rad per step; lowest natural frequency with all grips held
    response : (n, 2) array; elastic displacement per unit machine displacement
    stiffness : float, N/m; load per unit machine displacement
    cmod : float; CMOD per unit machine displacement
    rotation : (n,) array, rad/m; elastic rotation per unit machine displacement, 0 where particles do not rotate
    """

    omega: float
    response: np.ndarray
    stiffness: float
    cmod: float
    rotation: np.ndarray


def shear_stiffness(problem: Problem) -> np.ndarray | None:
    """K^s (m,), N/m, of bonds that slide; None where none do, and particles do not rotate."""
    return problem.law.k_s if isinstance(problem.law, SlidingLaw) else None


def stiffness_matrix(problem: Problem) -> sparse.csc_matrix:
    """Undamaged stiffness in N/m, degrees of freedom ordered x₀ y₀ x₁ y₁ …, or x₀ y₀ θ₀ x₁ … where particles rotate."""
    pairs = problem.bonds.pairs
    length, (x, y) = _reference(problem)
    shear = shear_stiffness(problem)
    none = np.zeros_like(x)
    opening = np.stack([-x, -y, x, y] if shear is None else [-x, -y, none, x, y, none], axis=1)
    element = problem.law.k_n[:, None, None] * opening[:, :, None] * opening[:, None, :]
    per = opening.shape[1] // 2
    if shear is not None:
        sliding = np.stack([y, -x, -length / 2, -y, x, -length / 2], axis=1)
        element = element + shear[:, None, None] * sliding[:, :, None] * sliding[:, None, :]
    dof = (per * pairs[:, :, None] + np.arange(per)).reshape(len(pairs), -1)
    rows, columns = np.repeat(dof, 2 * per, axis=1).ravel(), np.tile(dof, (1, 2 * per)).ravel()
    size = per * problem.particles.count
    return sparse.coo_matrix((element.ravel(), (rows, columns)), shape=(size, size)).tocsc()


def masses(problem: Problem) -> np.ndarray:
    """Fictitious masses (n,) in kg for a time step of 1 s: every particle is equally near instability.

    ω² ≤ 2 max λ(Σ k_n n⊗n + SLIDE k_s s⊗s)/m, from k (n·(u_j − u_i))² ≤ 2k (n·u_j)² + 2k (n·u_i)².
    """
    _, (x, y) = _reference(problem)
    shear = shear_stiffness(problem)
    normal, across = problem.law.k_n, 0.0 if shear is None else SLIDE * shear
    xx, yy = (_around(problem, normal * a * a + across * b * b) for a, b in ((x, y), (y, x)))
    xy = _around(problem, (normal - across) * x * y)
    largest = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    return largest / (2 * SAFETY**2)


def inertias(problem: Problem) -> np.ndarray:
    """Fictitious moments of inertia (n,) in kg m² for a time step of 1 s: ω² ≤ 2 TURN Σ k_s r²/I; 0 without K^s."""
    shear = shear_stiffness(problem)
    if shear is None:
        return np.zeros(problem.particles.count)
    length, _ = _reference(problem)
    return TURN * _around(problem, shear * length**2 / 4) / (2 * SAFETY**2)


def _reference(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Length (m,), m, and direction (2, m) of undeformed bonds."""
    length, direction = problem.bonds.reference(problem.particles.position)
    return length, direction.T


def _around(problem: Problem, value: np.ndarray) -> np.ndarray:
    """Sum over the bonds of each particle (n,)."""
    first, second = problem.bonds.pairs.T
    n = problem.particles.count
    return np.bincount(first, value, n) + np.bincount(second, value, n)


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
    mass = _mass_of_freedoms(problem)
    inverse = LinearOperator(held.shape, matvec=factor.solve, dtype=float)
    # a fixed first vector: ARPACK's own is random, and a run must be repeatable to the bit
    options = {"sigma": 0.0, "OPinv": inverse, "return_eigenvectors": False, "tol": 1e-4, "v0": np.ones(mass.size)}
    lowest = eigsh(held, k=1, M=sparse.diags(mass).tocsc(), **options)
    every = response.reshape(problem.particles.count, -1)
    field, rotation = every[:, :2], every[:, 2] if every.shape[1] == 3 else np.zeros(len(every))
    slip = drive - rows @ response
    load = spring * sum(s for s, grip in zip(slip, problem.grips, strict=True) if grip.role is Role.DRIVE)
    return Modes(float(np.sqrt(lowest[0])), field, float(load), problem.gauge.cmod(field), rotation)


def _mass_of_freedoms(problem: Problem) -> np.ndarray:
    """Masses and moments of inertia in the order of the stiffness matrix."""
    mass = masses(problem)
    if shear_stiffness(problem) is None:
        return np.repeat(mass, 2)
    return np.column_stack([mass, mass, inertias(problem)]).ravel()


def _row(problem: Problem, grip: Grip) -> np.ndarray:
    row = np.zeros((problem.particles.count, 2 if shear_stiffness(problem) is None else 3))
    row[grip.index, :2] = grip.weight[:, None] * grip.direction
    return row.ravel()
