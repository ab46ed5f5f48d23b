"""Crack path, tip and opening profile of any displacement field, measured by us or by others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, spatial

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.dic.jumps import Raster, jumps
from pipeline.dic.ridge import ridge

_STRAY = 5.0  # points farther from their plane than so many medians do not count


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
    nodes, through = ridge(found, raster, mouth)
    return _profile(raster, nodes, found.blind, through)


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
    left = value[use] - basis @ np.linalg.lstsq(basis, value[use], rcond=None)[0]
    x, y = (arm[use] / np.abs(arm).max()).T
    smooth = np.column_stack([x**i * y**j for i in range(4) for j in range(4 - i)])
    bent = value[use] - smooth @ np.linalg.lstsq(smooth, value[use], rcond=None)[0]
    torn = np.sum(left**2) / (len(left) - 6) < np.sum(bent**2) / max(len(left) - 10, 1)
    step, std = _without_strays(basis, value[use], left)
    return step, std, bool(torn)


def _without_strays(basis: np.ndarray, value: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, float]:
    """Step and standard deviation again, without points far from their plane: those beside a winding crack that lie
    on the other flank than the path says."""
    size = np.linalg.norm(left, axis=1)
    keep = size <= _STRAY * np.median(size)
    if np.linalg.matrix_rank(basis[keep]) < 6:
        keep = np.ones(len(left), bool)
    basis, value = basis[keep], value[keep]
    solution, *_ = np.linalg.lstsq(basis, value, rcond=None)
    variance = np.sum((value - basis @ solution) ** 2) / (2 * max(len(value) - 6, 1))
    return solution[3], float(np.sqrt(variance * np.linalg.inv(basis.T @ basis)[3, 3]))


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
