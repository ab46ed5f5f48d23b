"""A good order of elimination: nested dissection (George 1973), by where the variables are."""

from __future__ import annotations

import numpy as np
from scipy import sparse

SMALLEST = 40  # variables that are not divided further


def dissected(coupling: sparse.csr_array, place: np.ndarray, last: np.ndarray | None = None) -> np.ndarray:
    """The order (q,) in which two halves come before what separates them, and each half likewise.

    Parameters
    ----------
    coupling : (q, q) sparse array, symmetric; stored entries tell which variables are coupled
    place : (q, 2) array, m; where the particles are that the variables move
    last : (b,) int array; variables that come last, as they are
    """
    size = coupling.shape[0]
    pattern = sparse.csr_array((np.ones(coupling.nnz, np.float32), coupling.indices, coupling.indptr), coupling.shape)
    last = np.zeros(0, int) if last is None else last
    parts = [last]  # from the end
    waiting = [np.setdiff1d(np.arange(size), last)]
    while waiting:
        some = waiting.pop()
        half = _beyond_middle(place[some])
        if some.size <= SMALLEST or half.all() or not half.any():
            parts.append(some)
            continue
        right = np.zeros(size, np.float32)
        right[some[half]] = 1
        between = ~half & (pattern[some] @ right > 0)
        parts.append(some[between])
        waiting += [some[~half & ~between], some[half]]
    return np.concatenate(parts[::-1])


def _beyond_middle(place: np.ndarray) -> np.ndarray:
    """Which of some places (k, 2) lie beyond their median along the direction in which they extend farther."""
    along = place[:, np.argmax(np.ptp(place, axis=0))] if len(place) else np.zeros(0)
    return along >= np.median(along) if len(place) else np.zeros(0, bool)
