"""The part of a bonded packing that holds together when bonds carry no shear."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def main_part(count: int, pairs: np.ndarray) -> np.ndarray:
    """Which of `count` particles belong to the largest connected part; (count,) bool."""
    label = _components(count, pairs[:, 0], pairs[:, 1])
    return label == np.argmax(np.bincount(label))


def rigid_part(position: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Which particles belong to the largest body that central forces hold rigid; (n,) bool.

    Triangles that share a bond are a rigid cluster. The body begins as the largest cluster and takes in,
    until nothing more joins, each particle bonded to it in two directions, and each further cluster bound
    to it in all three motions of the plane, by shared particles or by bonds. What is left hangs on fewer
    than two bonds, on bonds in one line, or turns about a hinge: its stiffness matrix is singular. The body
    is rigid by construction; bodies that only several clusters together would hold are left out.

    Parameters
    ----------
    position : (n, 2) array, m
    pairs : (m, 2) int array; bonds of a triangular lattice
    """
    member = np.zeros(len(position), bool)
    clusters = _clusters(len(position), pairs)
    if not clusters:
        return member
    direction = _directions(position, pairs)
    member[clusters[0]] = True
    waiting = clusters[1:]
    while True:
        _take_in(member, pairs, direction)
        left = []
        for cluster in waiting:
            if _is_held(cluster, member, position, pairs):
                member[cluster] = True
            else:
                left.append(cluster)
        if len(left) == len(waiting):
            return member
        waiting = left


def _components(count: int, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    graph = coo_array((np.ones(len(first), bool), (first, second)), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def _clusters(count: int, pairs: np.ndarray) -> list[np.ndarray]:
    """Particles of each cluster of triangles joined along bonds, largest cluster first."""
    triangles = _triangles(count, pairs)
    label = _components(len(pairs), triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel())
    size = np.bincount(label)
    order = np.argsort(-size, kind="stable")
    bonds = np.split(np.argsort(label, kind="stable"), np.cumsum(size)[:-1])
    return [np.unique(pairs[bonds[k]]) for k in order if size[k] >= 3]


def _triangles(count: int, pairs: np.ndarray) -> np.ndarray:
    """Bonds (t, 3) of each triangle i < j < k of bonded particles."""
    key = pairs[:, 0].astype(np.int64) * count + pairs[:, 1]
    order = np.argsort(key)
    key = key[order]
    first, second = pairs[order, 0], pairs[order, 1].astype(np.int64)
    start: np.ndarray = np.searchsorted(first, second)
    stop: np.ndarray = np.searchsorted(first, second, side="right")
    found = []
    for step in range(int((stop - start).max(initial=0))):
        base = np.flatnonzero(start + step < stop)
        onward = start[base] + step
        closing = first[base].astype(np.int64) * count + second[onward]
        at = np.minimum(np.searchsorted(key, closing), key.size - 1)
        closed = key[at] == closing
        found.append(np.column_stack([base, onward, at])[closed])
    return order[np.concatenate(found)] if found else np.zeros((0, 3), np.intp)


def _directions(position: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """The lattice direction of each bond as one bit of three: 1, 2 or 4."""
    arm = position[pairs[:, 1]] - position[pairs[:, 0]]
    turn = np.arctan2(arm[:, 1], arm[:, 0])
    return (1 << (np.rint((turn - turn[0]) / (np.pi / 3)).astype(int) % 3)).astype(np.uint8)


def _take_in(member: np.ndarray, pairs: np.ndarray, direction: np.ndarray) -> None:
    """Add to `member` each particle bonded to it in two directions, until there is none."""
    while True:
        held = np.zeros(member.size, np.uint8)
        for here, there in ((0, 1), (1, 0)):
            rim = member[pairs[:, there]] & ~member[pairs[:, here]]
            np.bitwise_or.at(held, pairs[rim, here], direction[rim])
        new = ~np.isin(held, (0, 1, 2, 4))
        if not new.any():
            return
        member |= new


def _is_held(cluster: np.ndarray, member: np.ndarray, position: np.ndarray, pairs: np.ndarray) -> bool:
    """Whether a rigid cluster can neither move nor turn against the body."""
    centre = position[cluster].mean(axis=0)
    own = np.zeros(member.size, bool)
    own[cluster] = True
    shared = np.repeat(cluster[member[cluster]], 2)
    axes = np.tile(np.eye(2), (shared.size // 2, 1))
    link = pairs[(own[pairs] & ~member[pairs]).any(axis=1) & (member[pairs] & ~own[pairs]).any(axis=1)]
    at = np.where(own[link[:, 0]], link[:, 0], link[:, 1])
    points, normals = np.concatenate([shared, at]), np.vstack([axes, position[link[:, 1]] - position[link[:, 0]]])
    if len(points) < 3:
        return False
    arm = (position[points] - centre) / np.ptp(position[cluster], axis=0).max()
    normals = normals / np.hypot(*normals.T)[:, None]
    moment = arm[:, 0] * normals[:, 1] - arm[:, 1] * normals[:, 0]
    return bool(np.linalg.matrix_rank(np.column_stack([normals, moment]), tol=1e-6) == 3)
