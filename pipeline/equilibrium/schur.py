"""What a stiffness looks like from outside: Schur complements of sparse symmetric matrices."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from pipeline.equilibrium.cholesky import available, whole_factor
from pipeline.equilibrium.factor import SYMMETRIC, Solve


def schur_complement(
    inside: sparse.csc_array, across: sparse.csc_array, outer: sparse.csc_array, solve: Solve
) -> np.ndarray:
    """D − Bᵀ A⁻¹ B (b, b) of symmetric [[A, B], [Bᵀ, D]], with solutions of A, its variables in a good order.

    It is the last block of the factors of the whole matrix with D ordered last, at the price of one
    factorisation instead of b solutions. D is made heavier before and lighter after: the whole may be singular.
    """
    ballast = 2 * np.abs(outer.diagonal()) + np.abs(outer.diagonal()).mean()
    matrix = sparse.block_array([[inside, across], [across.T, outer + sparse.diags_array(ballast)]]).tocsc()
    schur = _last_product(matrix, ballast.size)
    if schur is None:
        schur = outer.toarray() - across.T @ solve(across.toarray())
    else:
        schur[np.diag_indices_from(schur)] -= ballast
    return 0.5 * (schur + schur.T)


def _last_product(matrix: sparse.csc_array, count: int) -> np.ndarray | None:
    """The last block (count, count) of L times that of U, K = L U; None if the variables were ordered otherwise."""
    if available():
        lower = whole_factor(matrix).last(count)
        return lower @ lower.T
    whole, start = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options=SYMMETRIC), matrix.shape[1] - count
    last = whole.perm_c[start:]
    if last.min() < start:  # the elimination tree has several roots
        return None
    return (whole.L.tocsr()[last][:, start:] @ whole.U.tocsr()[start:][:, last]).toarray()
