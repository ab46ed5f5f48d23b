"""Crack path, tip and opening profile of any displacement field, measured by us or by others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse, spatial
from scipy.sparse import csgraph

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.dic.jumps import Jumps, Raster, jumps

_STANDS_OUT = 8.0  # a ridge begins this many robust deviations above the field's own scatter of steps
_SHARE = 0.05  # … and at this share of the largest step
_BRIDGE = 7  # nodes; gaps in a crest that are bridged
_LEAST = 12  # nodes along a ridge that count as a crack


@dataclass(frozen=True, eq=False)
class Crack:
    """One crack; lengths in the unit of the field it was found in.

    Parameters
    ----------
    path : (k, 2) array; from the mouth to the tip
    arc : (k,) array; length along the path
    normal : (k, 2) array; unit vectors across the path
    opening, sliding : (k,) arrays; jump along the normal (positive where the flanks part) and along the path
    std : (k,) array; standard deviation of either
    closing : (k,) array; the opening made monotone towards the tip (isotonic least squares), 0 at the tip
    tip : (2,) array
    tip_std : float; along the path
    through : bool; the crack leaves the field at both ends, the tip is that of the field
    """

    path: np.ndarray
    arc: np.ndarray
    normal: np.ndarray
    opening: np.ndarray
    sliding: np.ndarray
    std: np.ndarray
    closing: np.ndarray
    tip: np.ndarray
    tip_std: float
    through: bool

    @property
    def length(self) -> float:
        return float(self.arc[-1])

    def opening_at(self, points: np.ndarray) -> np.ndarray:
        """Opening (n,) at the places of the path nearest to `points` (n, 2)."""
        return self.closing[spatial.cKDTree(self.path).query(points)[1]]


def find_crack(
    points: np.ndarray,
    displacement: np.ndarray,
    valid: np.ndarray | None = None,
    *,
    mouth: np.ndarray | None = None,
    blur: int | None = None,
) -> Crack:
    """The crack with the largest steps.

    Parameters
    ----------
    points : (n, 2) array; on a raster or scattered
    displacement : (n, 2) array, in the unit of the points
    valid : (n,) bool array, optional
    mouth : (2,) array, optional; the path begins at the end nearest to it, else at the end that is wider open
    blur : int, optional; nodes on either side over which the field smears a step, measured unless given

    Raises
    ------
    InputError
        for too small a field
    ConvergenceError
        if no crack stands out of the noise
    """
    displacement = np.asarray(displacement, float)
    finite = np.isfinite(displacement).all(axis=1)
    valid = finite if valid is None else finite & valid
    if valid.sum() < 100:
        raise InputError(f"a crack needs a field of at least 100 valid points, got {int(valid.sum())}")
    raster = Raster.of(np.asarray(points, float), displacement, valid)
    if min(raster.known.shape) < 24:
        raise InputError(f"a crack needs a field of at least 24 × 24 nodes, got {raster.known.shape}")
    found = jumps(raster, blur)
    nodes = _ridge(found)
    nodes, through = _directed(nodes, found, raster, mouth)
    nodes = _to_border(_centred(nodes, found), found, both=through)
    nodes = nodes if through else _straight_end(nodes, found.reach)
    return _profile(raster, nodes, found.blind, through)


def _ridge(found: Jumps) -> np.ndarray:
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


def _to_border(nodes: np.ndarray, found: Jumps, *, both: bool) -> np.ndarray:
    """Where a window reaches over the border of the field the path goes on straight; the mouth's end, or both."""
    last = np.array(found.size.shape) - 1.0
    for _ in range(2):
        depth = np.minimum(nodes, last - nodes).min(axis=1)
        inner = np.flatnonzero(depth > 1.5 * found.reach)
        if depth[0] < found.reach and inner.size > 2 * found.reach:
            keep = nodes[inner[0] :]
            at = np.arange(2 * found.reach)
            slope = np.array([np.polyfit(at, keep[: at.size, k], 1)[0] for k in (0, 1)])
            ahead = keep[0] - np.arange(4 * found.reach, 0, -1)[:, None] * slope / np.linalg.norm(slope)
            nodes = np.vstack([ahead[np.all((ahead >= 0) & (ahead <= last), axis=1)], keep])
        if not both:
            return nodes
        nodes = nodes[::-1]
    return nodes


def _straight_end(nodes: np.ndarray, reach: int) -> np.ndarray:
    """Where windows look around the tip the path goes on as it came."""
    if len(nodes) < 3 * reach:
        return nodes
    at = np.arange(len(nodes))
    use = slice(-3 * reach, -reach)
    line = [np.polyval(np.polyfit(at[use], nodes[use, k], 1), at[-reach:]) for k in (0, 1)]
    offset = nodes[-reach - 1] - [np.polyval(np.polyfit(at[use], nodes[use, k], 1), at[-reach - 1]) for k in (0, 1)]
    return np.vstack([nodes[:-reach], np.column_stack(line) + offset])


def _profile(raster: Raster, nodes: np.ndarray, blind: int, through: bool) -> Crack:
    path = raster.at(nodes)
    tangent = np.gradient(ndimage.gaussian_filter1d(path, 3.0, axis=0, mode="nearest"), axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    row, column = np.nonzero(raster.known)
    place = raster.at(np.column_stack([row, column]))
    value = raster.displacement[row, column]
    tree = spatial.cKDTree(place)
    reach = (blind + 6) * raster.step
    steps = [_two_planes(place[i] - p, value[i], n, blind * raster.step) for p, n, i in
             zip(path, normal, tree.query_ball_point(path, reach), strict=True)]  # fmt: skip
    jump, std = np.array([s[0] for s in steps]), np.array([s[1] for s in steps])
    if np.mean([s[2] for s in steps]) < 0.5:
        raise ConvergenceError("no crack stands out: where the field is steepest it is bent, not torn")
    arc = np.arange(len(path)) * raster.step
    opening, sliding = np.sum(jump * normal, axis=1), np.sum(jump * tangent, axis=1)
    end, end_std = (
        (float(arc[-1]), 0.0) if through else _tip(arc, np.hypot(opening, sliding), std, blind * raster.step, reach)
    )
    keep = arc <= end
    tip = np.array([np.interp(end, arc, path[:, k]) for k in (0, 1)])
    if end > arc[-1]:
        tip = path[-1] + (end - arc[-1]) * tangent[-1]
    pieces = {"arc": arc, "normal": normal, "opening": opening, "sliding": sliding, "std": std, "path": path}
    pieces = {k: v[keep] for k, v in pieces.items()}
    closing = _isotonic(pieces["opening"], pieces["std"])
    if not through and keep.sum() and closing.size:
        closing = np.append(closing[:-1], 0.0)
        pieces["path"] = np.vstack([pieces["path"][:-1], tip])
        pieces["arc"] = np.append(pieces["arc"][:-1], end)
    return Crack(closing=closing, tip=tip, tip_std=end_std, through=through, **pieces)


def _two_planes(arm: np.ndarray, value: np.ndarray, normal: np.ndarray, blind: float) -> tuple[np.ndarray, float, bool]:
    """Step (2,) between planes fitted to the two flanks, its standard deviation, and whether they fit better than
    one smooth surface of third order."""
    across = arm @ normal
    use = np.abs(across) >= 0.99 * blind
    side = np.sign(across[use])
    basis = np.column_stack([np.ones(use.sum()), arm[use], 0.5 * side, arm[use] * side[:, None]])
    if min((side > 0).sum(), (side < 0).sum()) < 6 or np.linalg.matrix_rank(basis) < 6:
        return np.full(2, np.nan), np.nan, True
    solution, *_ = np.linalg.lstsq(basis, value[use], rcond=None)
    left = value[use] - basis @ solution
    variance = np.sum(left**2) / (2 * max(len(left) - 6, 1))
    x, y = (arm[use] / np.abs(arm).max()).T
    smooth = np.column_stack([x**i * y**j for i in range(4) for j in range(4 - i)])
    bent = value[use] - smooth @ np.linalg.lstsq(smooth, value[use], rcond=None)[0]
    torn = np.sum(left**2) / (len(left) - 6) < np.sum(bent**2) / max(len(left) - 10, 1)
    return solution[3], float(np.sqrt(variance * np.linalg.inv(basis.T @ basis)[3, 3])), bool(torn)


def _tip(arc: np.ndarray, size: np.ndarray, std: np.ndarray, blind: float, reach: float) -> tuple[float, float]:
    """Where the step would vanish, with its standard deviation.

    Near a sharp tip the square of the step is linear in the distance (Irwin 1957), at a hinge the step itself; the law
    that fits better is taken, and where both fit their difference counts as uncertainty. The last stretch is left
    out, in it the flanks' windows reach around the tip.
    """
    good = np.isfinite(size) & np.isfinite(std)
    stretch = max(0.4 * arc[-1], 2 * reach)
    use = good & (arc > arc[-1] - reach - stretch) & (arc < arc[-1] - reach)
    fits = [_vanishing(arc[use], size[use], power) for power in (2, 1)] if use.sum() >= 5 else []
    laws = [law for law in fits if law is not None]
    if not laws:
        return float(arc[-1]), float(np.hypot(blind, blind))
    laws.sort(key=lambda law: law[2])
    end, spread, left = laws[0]
    if len(laws) == 2 and laws[1][2] < 1.5 * left:
        spread = float(np.hypot(spread, 0.5 * (laws[1][0] - end)))
    return float(np.clip(end, arc[0], arc[-1] + 3 * reach)), float(np.hypot(spread, 0.5 * blind))


def _vanishing(arc: np.ndarray, size: np.ndarray, power: int) -> tuple[float, float, float] | None:
    """Root of the line through size**power, its standard deviation and what is left of size; None if it rises."""
    (slope, level), cov = np.polyfit(arc, size**power, 1, cov=True)
    if slope >= 0:
        return None
    gradient = np.array([level / slope**2, -1 / slope])
    fitted = np.clip(slope * arc + level, 0, None) ** (1 / power)
    return -level / slope, float(np.sqrt(gradient @ cov @ gradient)), float(np.mean((size - fitted) ** 2))


def _isotonic(value: np.ndarray, std: np.ndarray) -> np.ndarray:
    """The non-increasing sequence nearest to `value`, weighted by 1/std²; pool adjacent violators."""
    weight = 1 / np.maximum(np.nan_to_num(std, nan=np.inf), 1e-300) ** 2
    blocks: list[list[float]] = []
    for v, w in zip(np.nan_to_num(value), np.maximum(weight, 1e-300), strict=True):
        blocks.append([v, w, 1])
        while len(blocks) > 1 and blocks[-2][0] < blocks[-1][0]:
            v2, w2, n2 = blocks.pop()
            v1, w1, n1 = blocks.pop()
            blocks.append([(v1 * w1 + v2 * w2) / (w1 + w2), w1 + w2, n1 + n2])
    return np.concatenate([np.full(int(n), v) for v, _, n in blocks]) if blocks else np.zeros(0)
