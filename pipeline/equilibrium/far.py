"""What stays elastic around the strip: eliminated variables that follow the kept ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pipeline.equilibrium.cholesky import available, whole_factor
from pipeline.equilibrium.factor import Solve, factorise_elastic, singular
from pipeline.equilibrium.islands import Islands

BATCH = 64  # right-hand sides at a time


@dataclass(frozen=True)
class FarField:
    """The eliminated variables: K_ff q_f + K_fk q_k + K_fs s = J_ofᵀ q.

    Parameters
    ----------
    inner : (f,) int array; eliminated variables, numbered in the whole model, in a good order of elimination
    solve : function; K_ff⁻¹ b of right-hand sides (f,) or (f, k), N
    coupling : (f, k) sparse array K_fk, and drive (f,) array K_fs, N/m
    """

    inner: np.ndarray
    solve: Solve
    coupling: sparse.csr_array
    drive: np.ndarray

    def follow(self, kept: np.ndarray, machine: float, islands: Islands, extra: np.ndarray) -> np.ndarray:
        """Eliminated variables (f,), m."""
        pushed = islands.jacobian.T @ islands.tension_lost(extra)
        return self.solve(pushed - self.coupling @ kept - machine * self.drive)

    def columns(self, right: sparse.csc_array) -> np.ndarray:
        """K_ff⁻¹ B (f, k) of sparse right-hand sides, some at a time."""
        parts = [self.solve(right[:, k : k + BATCH].toarray()) for k in range(0, right.shape[1], BATCH)]
        return np.hstack(parts)


def solve_far(stiffness: sparse.csc_array) -> Solve:
    """Solutions with the stiffness K_ff, its variables in a good order of elimination.

    Raises
    ------
    InputError
        if it is singular: particles that may move although all kept ones are held
    """
    if not available():
        return factorise_elastic(stiffness).solve
    factor = whole_factor(stiffness)
    if factor.raised:
        raise singular()
    return factor.solve
