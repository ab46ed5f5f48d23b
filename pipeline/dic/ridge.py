"""The way along the crest of the steps of a field: where a crack runs."""

from __future__ import annotations

import numpy as np
from scipy import ndimage, sparse, spatial
from scipy.sparse import csgraph

from pipeline.core.errors import ConvergenceError
from pipeline.dic.jumps import Jumps, Raster

_STANDS_OUT = 8.0  # a ridge begins this many robust deviations above the field's own scatter of steps
_SHARE = 0.05  # … and at this share of the largest step
_BRIDGE = 7  # nodes; gaps in a crest that are bridged
_SWING, _TRIALS = np.deg2rad(60.0), 61  # directions tried at the border, either way of straight on
_CLEAR = 25.0  # variances of the rest by which another direction must be better
_ON = 0.6  # nodes; so near to a line the side is not asked for
_LEAST = 12  # nodes along a ridge that count as a crack


def ridge(found: Jumps, raster: Raster, mouth: np.ndarray | None) -> tuple[np.ndarray, bool]:
    """The path of the strongest steps, from the mouth on.

    Parameters
    ----------
    found : Jumps
    raster : Raster; the field they were found in
    mouth : (2,) array, optional; the path begins at the end nearest to it, else at the end on the border or wider open

    Returns
    -------
    nodes : (k, 2) float array; row, column, one node apart
    through : bool; the path runs from border to border

    Raises
    ------
    ConvergenceError
        if nothing stands out of the noise
    """
    nodes, through = _directed(_strongest(found), found, raster, mouth)
    nodes = _to_border(_centred(nodes, found), found, raster, both=through)
    return (nodes if through else _straight_end(nodes, found.reach)), through


def _strongest(found: Jumps) -> np.ndarray:
    """Nodes (k, 2) along the strongest ridge of steps, from end to end."""
    size = found.size
    middle = float(np.median(size))
    scatter = 1.4826 * float(np.median(np.abs(size - middle)))
    mask = size > max(middle + _STANDS_OUT * scatter, _SHARE * float(np.quantile(size, 0.999)))
    crest = mask & _crest(found)
    label, count = ndimage.label(ndimage.binary_dilation(crest, np.ones((_BRIDGE, _BRIDGE))) & mask, np.ones((3, 3)))
    if not count:
        raise ConvergenceError("no crack stands out of the noise of the field")
    weight = ndimage.sum_labels(np.where(crest, size, 0), label, np.arange(1, count + 1))
    inside = np.argwhere(label == int(np.argmax(weight)) + 1)
    graph, ends = _graph(inside, size), crest[inside[:, 0], inside[:, 1]]
    start = last = int(np.argmax(ends))
    for _ in range(3):  # from end to end: the farthest crest, and the one farthest from that
        far, previous = csgraph.dijkstra(graph, indices=start, return_predecessors=True)
        start, last = int(np.argmax(np.where(np.isfinite(far) & ends, far, -1))), start
    node = start
    back = [node]
    while node != last:
        node = int(previous[node])
        back.append(node)
    way = back[::-1]
    if len(way) < _LEAST:
        raise ConvergenceError(f"the strongest step runs over {len(way)} nodes only, a crack needs {_LEAST}")
    return inside[way]


def _crest(found: Jumps) -> np.ndarray:
    """Nodes that are the strongest along their own normal, as far as a window reaches: no echo of a ridge beside it."""
    row, column = np.indices(found.size.shape).astype(float)
    crest = np.ones(found.size.shape, bool)
    for s in [s for s in range(-found.reach, found.reach + 1) if s]:
        where = [row + s * np.sin(found.angle), column + s * np.cos(found.angle)]
        crest &= found.size >= ndimage.map_coordinates(found.size, where, order=1, mode="nearest")
    return crest


def _graph(inside: np.ndarray, size: np.ndarray) -> sparse.csr_matrix:
    """Ways between neighbouring nodes, short along the crest."""
    pairs = spatial.cKDTree(inside).query_pairs(1.5, output_type="ndarray")
    strength = size[inside[:, 0], inside[:, 1]]
    local = ndimage.maximum_filter(size, 9)[inside[:, 0], inside[:, 1]]
    slow = (local / np.maximum(strength, 1e-300)) ** 4
    length = np.linalg.norm(inside[pairs[:, 0]] - inside[pairs[:, 1]], axis=1)
    cost = length * 0.5 * (slow[pairs[:, 0]] + slow[pairs[:, 1]])
    graph = sparse.csr_matrix((cost, pairs.T), shape=(len(inside),) * 2)
    return graph + graph.T


def _directed(nodes: np.ndarray, found: Jumps, raster: Raster, mouth: np.ndarray | None) -> tuple[np.ndarray, bool]:
    """The nodes from the mouth on, and whether both ends lie on the border."""
    last = np.array(found.size.shape) - 1
    border = [bool(np.any(end < 3) or np.any(end > last - 3)) for end in (nodes[0], nodes[-1])]
    if mouth is not None:
        ends = np.linalg.norm(raster.at(nodes[[0, -1]]) - np.asarray(mouth), axis=1)
        turn = ends[1] < ends[0]
    elif border[0] != border[1]:
        turn = border[1]
    else:
        share = max(len(nodes) // 5, 3)
        size = found.size[nodes[:, 0], nodes[:, 1]]
        turn = size[-share:].mean() > size[:share].mean()
    return (nodes[::-1] if turn else nodes), all(border)


def _centred(nodes: np.ndarray, found: Jumps) -> np.ndarray:
    """The path on the crest to a fraction of a node, smoothed over the length of a flank; (k, 2) float."""
    angle = found.angle[nodes[:, 0], nodes[:, 1]]
    normal = np.column_stack([np.sin(angle), np.cos(angle)])
    at = np.arange(-3, 3.01, 0.5)
    where = nodes[:, None, :] + at[None, :, None] * normal[:, None, :]
    size = ndimage.map_coordinates(found.size, np.moveaxis(where, 2, 0), order=1, mode="nearest")
    weight = np.clip(size - 0.8 * size.max(axis=1, keepdims=True), 0, None)
    moved = nodes + (np.sum(weight * at, axis=1) / weight.sum(axis=1))[:, None] * normal
    smooth = ndimage.gaussian_filter1d(moved, 2.0, axis=0, mode="nearest")
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))])
    even = np.arange(0, length[-1] + 1e-9, 1.0)
    return np.column_stack([np.interp(even, length, smooth[:, k]) for k in (0, 1)])


def _to_border(nodes: np.ndarray, found: Jumps, raster: Raster, *, both: bool) -> np.ndarray:
    """Where a window reaches over the border of the field the path goes on straight; the mouth's end, or both."""
    last = np.array(found.size.shape) - 1.0
    for _ in range(2):
        depth = np.minimum(nodes, last - nodes).min(axis=1)
        inner = np.flatnonzero(depth > 1.5 * found.reach)
        if depth[0] < found.reach and inner.size > 2 * found.reach:
            keep = nodes[inner[0] :]
            at = np.arange(2 * found.reach)
            slope = np.array([np.polyfit(at, keep[: at.size, k], 1)[0] for k in (0, 1)])
            out = _parting(raster, keep[0], -slope / np.linalg.norm(slope), found)
            ahead = keep[0] + np.arange(4 * found.reach, 0, -1)[:, None] * out
            nodes = np.vstack([ahead[np.all((ahead >= 0) & (ahead <= last), axis=1)], keep])
        if not both:
            return nodes
        nodes = nodes[::-1]
    return nodes


def _parting(raster: Raster, start: np.ndarray, straight: np.ndarray, found: Jumps) -> np.ndarray:
    """The direction from a node in which a line parts the field best into two planes; straight on where none is better.

    Parameters
    ----------
    raster : Raster
    start : (2,) array; row, column
    straight : (2,) array, unit vector; as the path came
    found : Jumps
    """
    node = np.argwhere(raster.known)
    arm = node - start
    use = (arm @ straight > 0) & (np.hypot(*arm.T) < 4 * found.reach)
    arm, value = arm[use], raster.displacement[tuple(node[use].T)]
    best, least, first = straight, np.inf, np.inf
    for turn in (0.0, *np.linspace(-_SWING, _SWING, _TRIALS)):
        c, s = np.cos(turn), np.sin(turn)
        way = straight @ np.array([[c, s], [-s, c]])
        across = arm @ [-way[1], way[0]]
        side = np.where(np.abs(across) < _ON, 0.0, np.sign(across))
        basis = np.column_stack([np.ones(len(arm)), arm, side, arm * side[:, None]])[side != 0]
        if min((side > 0).sum(), (side < 0).sum()) < 6:
            continue
        left = value[side != 0] - basis @ np.linalg.lstsq(basis, value[side != 0], rcond=None)[0]
        square = float(np.mean(left**2))
        first = square if turn == 0 else first
        if square < least:
            best, least = way, square
    clear = (first - least) * 2 * len(arm) > _CLEAR * least
    return best if clear else straight


def _straight_end(nodes: np.ndarray, reach: int) -> np.ndarray:
    """Where windows look around the tip the path goes on as it came."""
    if len(nodes) < 3 * reach:
        return nodes
    at = np.arange(len(nodes))
    use = slice(-3 * reach, -reach)
    line = [np.polyval(np.polyfit(at[use], nodes[use, k], 1), at[-reach:]) for k in (0, 1)]
    offset = nodes[-reach - 1] - [np.polyval(np.polyfit(at[use], nodes[use, k], 1), at[-reach - 1]) for k in (0, 1)]
    return np.vstack([nodes[:-reach], np.column_stack(line) + offset])
