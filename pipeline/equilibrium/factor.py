"""Sparse factorisations of stiffnesses: exact ones, and rough ones to measure steps by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import SuperLU, splu

from pipeline.core.errors import InputError

Solve = Callable[[np.ndarray], np.ndarray]

SYMMETRIC = {"SymmetricMode": True}
SMALLEST = 1e-7  # of the largest eigenvalue: smaller ones, and negative ones, are round-off of single precision


def factorise(stiffness: sparse.csc_array) -> SuperLU:
    """Symmetric factorisation without pivoting, for positive definite matrices."""
    return splu(stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=SYMMETRIC)


def factorise_elastic(stiffness: sparse.csc_array) -> SuperLU:
    """The factorised elastic stiffness.

    Raises
    ------
    InputError
        if it is singular: grips that leave a rigid motion, or particles without bonds
    """
    try:
        factor = factorise(stiffness)
    except RuntimeError:
        raise singular() from None
    pivots = np.abs(factor.U.diagonal())
    if not pivots.min() > 1e-13 * pivots.max():
        raise singular()
    return factor


def singular() -> InputError:
    """What is said of a specimen that can move without resistance."""
    return InputError(
        "the elastic stiffness of the specimen is singular: the grips must stop every rigid motion and every "
        "particle needs at least two bonds that are not in line"
    )


def rough_solve(stiffness: sparse.csc_array, ordered: bool = False) -> Solve:
    """Solutions that only measure steps and decide no result: single precision halves what each has to read.

    `ordered`: the variables already stand in a good order of elimination.
    """
    order = "NATURAL" if ordered else "MMD_AT_PLUS_A"
    single = sparse.csc_array(
        (stiffness.data.astype(np.float32), stiffness.indices, stiffness.indptr), shape=stiffness.shape
    )
    factor = splu(single, permc_spec=order, diag_pivot_thresh=0.0, options=SYMMETRIC)
    return lambda right: factor.solve(right.astype(np.float32)).astype(float)


def rough_dense_solve(stiffness: np.ndarray) -> Solve:
    """The same for a dense matrix (q, q); where it is definite but for round-off, its eigenvalues are raised."""
    single = stiffness.astype(np.float32)
    try:
        factor = linalg.cho_factor(single, lower=True, overwrite_a=True, check_finite=False)
    except linalg.LinAlgError:
        strength, shape = linalg.eigh(stiffness)
        strength = np.maximum(strength, SMALLEST * np.abs(strength).max() or 1.0)
        return lambda right: shape @ (shape.T @ right / strength)
    return lambda right: linalg.cho_solve(factor, right.astype(np.float32), check_finite=False).astype(float)


def reordered(solve: Solve, order: np.ndarray) -> Solve:
    """Solutions (q,) or (q, k) with a matrix that was factorised with its variables in another order (q,)."""

    def solution(right: np.ndarray) -> np.ndarray:
        found = np.empty(right.shape)
        found[order] = solve(right[order])
        return found

    return solution
