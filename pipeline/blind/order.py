"""In which order nodes are eliminated: halves first, then the few nodes between them (George 1973)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

SMALL = 12  # nodes that are not halved further
CUTS = (0.45, 0.5, 0.55)  # shares of the nodes on one side, of which the thinnest cut is taken


def dissected(position: np.ndarray, neighbours: csr_matrix) -> np.ndarray:
    """Nested dissection by straight cuts.

    Parameters
    ----------
    position : (n, 2) array, m
    neighbours : (n, n) sparse; not zero where two nodes stand in one equation

    Returns
    -------
    (n,) int array; nodes in the order of their elimination
    """
    return np.concatenate(_parts(np.arange(len(position)), position, neighbours)).astype(int)


def _parts(nodes: np.ndarray, position: np.ndarray, neighbours: csr_matrix) -> list[np.ndarray]:
    if len(nodes) <= SMALL:
        return [nodes]
    cuts = [_cut(nodes, position[nodes, axis], share, neighbours) for axis in (0, 1) for share in CUTS]
    one, two, between = min(cuts, key=lambda cut: len(cut[2]) if len(cut[0]) and len(cut[1]) else np.inf)
    if not len(one) or not len(two):
        return [nodes]
    return [*_parts(one, position, neighbours), *_parts(two, position, neighbours), between]


def _cut(
    nodes: np.ndarray, along: np.ndarray, share: float, neighbours: csr_matrix
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes on both sides of a straight cut, and those of the second side that touch the first."""
    left = along < np.quantile(along, share)
    marked = np.zeros(neighbours.shape[0])
    marked[nodes[left]] = 1.0
    right = nodes[~left]
    touching = neighbours[right] @ marked > 0
    return nodes[left], right[~touching], right[touching]
