"""A stiffness of bonds and a dense support, assembled again and again in one pattern."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse


@dataclass(frozen=True)
class Assembly:
    """Where the stiffness of every bond, and of the support, goes.

    Parameters
    ----------
    share : (z, m) sparse array; what a bond of 1 N/m adds to the z stored entries
    place : (b * b,) int array; entries that a support between b variables goes to
    indices, indptr : pattern of the (q, q) csc array
    """

    share: sparse.csr_array
    place: np.ndarray
    indices: np.ndarray
    indptr: np.ndarray

    def stiffness(self, weight: np.ndarray, support: np.ndarray) -> sparse.csc_array:
        """Stiffness (q, q), N/m, of bonds (m,), N/m, on a support (b, b), N/m."""
        data = self.share @ weight
        data[self.place] += support.ravel()
        size = self.indptr.size - 1
        return sparse.csc_array((data, self.indices, self.indptr), shape=(size, size))


def assembly(jacobian: sparse.csr_array, edge: np.ndarray) -> Assembly:
    """The assembly of bonds with openings C q, C (m, q), and a support between the variables `edge` (b,)."""
    bonds, size = jacobian.shape
    count = np.diff(jacobian.indptr)
    bond = np.repeat(np.arange(bonds), count)
    first = np.repeat(np.arange(jacobian.nnz), count[bond])  # every entry of a row with every other
    within = np.arange(first.size) - np.repeat(np.cumsum(count[bond]) - count[bond], count[bond])
    second = jacobian.indptr[bond[first]] + within
    column = jacobian.indices.astype(np.int64)
    key = np.concatenate([column[first] * size + column[second], (edge[:, None] * size + edge).ravel()])
    entries, place = np.unique(key, return_inverse=True)
    product = jacobian.data[first] * jacobian.data[second]
    share = sparse.coo_array((product, (place[: first.size], bond[first])), shape=(entries.size, bonds)).tocsr()
    start = np.searchsorted(entries, np.arange(size + 1, dtype=np.int64) * size)
    return Assembly(share, place[first.size :], (entries % size).astype(np.int32), start.astype(np.int32))
