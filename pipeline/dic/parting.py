"""Subsets that one warp does not explain: cut by a line that is found, each part with its own warp.

Poissant & Barthelat (2010) split subsets along a crack; here the line comes from the grey values alone. The
motions that are tried on the two sides are those of sound neighbours all around and the point's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from pipeline.dic.grid import Grid
from pipeline.dic.noise import PARAMETERS, MatchNoise
from pipeline.dic.settings import Settings
from pipeline.dic.status import Status

_SECTORS = 12
_WAVES = 4
_SATURATED = 5  # Outcome of cpp/subset.hpp
_GAIN = 36.0  # χ² that a cut must save: 1 in 1000 under white noise, for six parameters and the search of the line
_BENT = 0.75  # share of the saving from which second-order terms explain it; they explain at most 0.55 of a step
_SIDE = 25.0  # χ² by which the centre's side must be preferred
_CLOSE_PX = 1.0  # nearer to the centre than this a line is not located by its pixels, which the gap has blurred …
_CLOSE_SIDE = 200.0  # … unless χ² speaks so clearly
_WIDE_PX = 3.0  # a wider band beside the line that matches neither side may be a strip of its own
_HARMLESS_PX = 0.05  # a jump so small may be put on the wrong side


@dataclass(eq=False)
class Sheet:
    """The state of every point while a picture is being matched; arrays as in `Correlation`."""

    warp: np.ndarray
    status: np.ndarray
    zncc: np.ndarray
    iterations: np.ndarray
    covariance: np.ndarray  # (n, 3) of u, v and mixed, per grey² of noise
    level: np.ndarray
    count: np.ndarray  # (n,) pixels of the subset
    variance: np.ndarray  # (n,) grey², of the part that holds the centre
    suspect: np.ndarray  # (n, 4) line and jump that the score test proposes
    bend: np.ndarray  # (n,) grey², by which second-order terms would lower Σe²
    line: np.ndarray
    far: np.ndarray
    jump: np.ndarray
    jump_std: np.ndarray

    @property
    def sound(self) -> np.ndarray:
        return self.status <= Status.SPLIT

    @property
    def open(self) -> np.ndarray:
        """Points that a cut may help."""
        return ~self.sound & (self.status != Status.OUTSIDE)


@dataclass(frozen=True, eq=False)
class Match:
    """Two pictures in the compiled core, the grid between them and, where the reference is a later picture,
    the warps that carried the points there."""

    core: ModuleType
    reference: Any
    current: Any
    grid: Grid
    settings: Settings
    carried: np.ndarray | None = None  # (n, 6)
    carried_far: np.ndarray | None = None  # (n, 6)
    carried_line: np.ndarray | None = None  # (n, 2), offset −1 where there is no line


def part(match: Match, sheet: Sheet, noise: MatchNoise) -> None:
    """Cut the points of `sheet` that are not sound, in waves from their sound neighbours; changes `sheet`."""
    open_points = np.flatnonzero(sheet.open)
    tried = np.full((len(sheet.status), _SECTORS), -2)
    for _ in range(_WAVES):
        chosen = _neighbours(match, sheet, open_points)
        news = np.any(chosen != tried[open_points], axis=1) & np.any(chosen >= 0, axis=1)
        open_points, chosen = open_points[news], chosen[news]
        gone = _leaves(match, sheet, open_points, chosen)
        sheet.status[open_points[gone]] = Status.OUTSIDE
        open_points, chosen = open_points[~gone], chosen[~gone]
        if not open_points.size:
            return
        tried[open_points] = chosen
        _try_whole(match, sheet, noise, open_points, chosen)
        left = ~sheet.sound[open_points]
        _try_cut(match, sheet, noise, open_points[left], chosen[left])
        open_points = np.flatnonzero(sheet.open)


def _neighbours(match: Match, sheet: Sheet, of: np.ndarray) -> np.ndarray:
    """The nearest sound point in each sector around the points `of`; (len(of), sectors) int, −1 where none."""
    step = match.settings.grid_step_px
    reach = (2 * match.settings.half) // step + 2
    offsets = [(r, c) for r in range(-reach, reach + 1) for c in range(-reach, reach + 1) if r or c]
    offsets = sorted((o for o in offsets if np.hypot(*o) <= reach), key=lambda o: (np.hypot(*o), o))
    chosen = np.full((of.size, _SECTORS), -1)
    for r, c in offsets:
        sector = int((np.arctan2(r, c) + np.pi) / (2 * np.pi) * _SECTORS) % _SECTORS
        node = match.grid.shifted(r, c, of)
        use = (chosen[:, sector] < 0) & (node >= 0) & sheet.sound[node]
        chosen[use, sector] = node[use]
    return chosen


def _extrapolated(match: Match, sheet: Sheet, to: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Warps, levels and places (..., 10) of the points `source`, seen from the points `to` (broadcast together)."""
    arm = match.grid.points[source] - match.grid.points[to]
    warp = sheet.warp[source].copy()
    warp[..., 0] -= warp[..., 2] * arm[..., 0] + warp[..., 3] * arm[..., 1]
    warp[..., 1] -= warp[..., 4] * arm[..., 0] + warp[..., 5] * arm[..., 1]
    return np.concatenate([warp, sheet.level[source], arm], axis=-1)


def _leaves(match: Match, sheet: Sheet, points: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Which subsets are carried over the border of the picture by every motion around; (len(points),) bool."""
    moved = (
        match.grid.points[points][:, None]
        + _extrapolated(match, sheet, points[:, None], np.maximum(chosen, 0))[..., :2]
    )
    last = np.array(match.current.shape[::-1]) - 1 - match.settings.half
    outside = np.any((moved < match.settings.half) | (moved > last), axis=2)
    return np.all(outside | (chosen < 0), axis=1)


def _try_whole(match: Match, sheet: Sheet, noise: MatchNoise, points: np.ndarray, chosen: np.ndarray) -> None:
    """A point that lost its way is matched again from its nearest sound neighbour."""
    lost = ~np.isfinite(sheet.variance[points]) | (sheet.variance[points] > 4 * noise.variance)
    points, chosen = points[lost], chosen[lost]
    if not points.size:
        return
    arm = np.linalg.norm(match.grid.points[chosen] - match.grid.points[points][:, None], axis=2)
    nearest = chosen[np.arange(len(points)), np.argmin(np.where(chosen >= 0, arm, np.inf), axis=1)]
    guess = _extrapolated(match, sheet, points, nearest)[:, :6]
    carried = None if match.carried is None else np.ascontiguousarray(match.carried[points])
    found = match.core.match(
        match.reference,
        match.current,
        match.grid.points[points],
        np.ascontiguousarray(guess),
        carried,
        accept=match.settings.accept_zncc,
        **match.settings.solver(),
    )
    sheet.status[points[found["outcome"] == _SATURATED]] = Status.SATURATED
    adopt(sheet, points, found, noise, better=True)


def adopt(sheet: Sheet, points: np.ndarray, found: dict[str, np.ndarray], noise: MatchNoise, *, better: bool) -> None:
    """Take over whole-subset matches of `points`, all of them or only those that are sound; changes `sheet`."""
    variance = found["residual"] / np.maximum(found["count"] - PARAMETERS, 1)
    fine = (variance <= noise.limit(found["count"])) & (found["score"] <= noise.suspicious)
    fine = (found["outcome"] == 0) & (fine | _bent(found, variance, noise))
    take = fine if better else np.ones(len(points), bool)
    to = points[take]
    for name in ("warp", "zncc", "iterations", "covariance", "level", "suspect", "bend", "count"):
        getattr(sheet, name)[to] = found[name][take]
    sheet.variance[to] = np.where(found["outcome"] == 0, variance, np.inf)[take]
    sheet.status[points[fine]] = Status.OK


def _bent(found: dict[str, np.ndarray], variance: np.ndarray, noise: MatchNoise) -> np.ndarray:
    """Subsets whose misfit is clear and is that of a smoothly bent field: the affine warp is its low-pass filter."""
    excess = (variance - noise.variance) * found["count"]
    straight = variance - found["bend"] / np.maximum(found["count"] - PARAMETERS, 1)
    clear = excess > 4 * noise.variance * np.sqrt(2.0 * found["count"]) * noise.excess
    return clear & (found["bend"] > _BENT * excess) & (straight <= noise.limit(found["count"]))


def _candidates(match: Match, sheet: Sheet, points: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of warp and level for all points one after the other, and where each point's rows begin."""
    rows = _extrapolated(match, sheet, points[:, None], np.maximum(chosen, 0))
    own = np.column_stack([sheet.warp[points], sheet.level[points], np.full((len(points), 2), np.nan)])
    near, far = own.copy(), own.copy()
    near[:, :2] -= 0.4 * sheet.suspect[points, 2:]
    far[:, :2] += 0.6 * sheet.suspect[points, 2:]
    has_own = np.isfinite(sheet.variance[points])
    every = np.concatenate([rows, own[:, None], near[:, None], far[:, None]], axis=1)
    use = np.concatenate([chosen >= 0, np.repeat(has_own[:, None], 3, axis=1)], axis=1)
    first = np.concatenate([[0], np.cumsum(use.sum(axis=1))]).astype(np.int32)
    return np.ascontiguousarray(every[use]), first


def _try_cut(match: Match, sheet: Sheet, noise: MatchNoise, points: np.ndarray, chosen: np.ndarray) -> None:
    if not points.size:
        return
    rows, first = _candidates(match, sheet, points, chosen)
    carried = (match.carried, match.carried_far, match.carried_line)
    found = match.core.split(
        match.reference,
        match.current,
        match.grid.points[points],
        rows,
        first,
        noise.variance,
        *(None if c is None else np.ascontiguousarray(c[points]) for c in carried),
        **match.settings.solver(),
    )
    _judge(sheet, noise, points, found)


def _judge(sheet: Sheet, noise: MatchNoise, points: np.ndarray, found: dict[str, np.ndarray]) -> None:
    """Decide between whole, cut and failed for points that were tried with a cut; changes `sheet`."""
    near_n, far_n = found["count"].T
    variance = found["near_fit"][:, 1] / np.maximum(near_n - PARAMETERS, 1)
    far_variance = found["far_fit"][:, 1] / np.maximum(far_n - PARAMETERS, 1)
    far = found["far_matched"].astype(bool) & (far_variance <= noise.limit(far_n))
    jump, jump_std = _jumps(found, noise.variance)
    single, parted, swapped = found["cost"].T
    excess = (sheet.variance[points] / noise.variance - 1) * np.maximum(
        sheet.count[points], 1
    )  # not clipped, as the bend is not
    bent = sheet.bend[points] / noise.variance > _BENT * np.maximum(excess, single - parted)
    saves = (single - parted > _GAIN * noise.score) & ~bent
    fits = found["attempted"].astype(bool) & (variance <= noise.limit(near_n))
    one_piece = (found["near_fit"][:, 4] <= noise.refused) & ~(far & (found["far_fit"][:, 4] > noise.refused))
    preferred = (swapped - parted) / noise.score
    told = (preferred > _SIDE) & ((found["line"][:, 1] > _CLOSE_PX) | (preferred > _CLOSE_SIDE))
    told &= ~((found["margin"] > _WIDE_PX) & (found["margin"] > found["line"][:, 1]))
    told |= far & (np.linalg.norm(jump, axis=1) < _HARMLESS_PX)
    straight = sheet.variance[points] - sheet.bend[points] / np.maximum(sheet.count[points] - PARAMETERS, 1)
    whole = ~saves & (straight <= noise.limit(sheet.count[points]))
    sheet.status[points] = np.select(
        [whole, fits & saves & one_piece & told, fits & saves & one_piece, fits & saves],
        [Status.OK, Status.SPLIT, Status.ON_CRACK, Status.TWO_CRACKS],
        np.where(sheet.status[points] == Status.SATURATED, Status.SATURATED, Status.POOR_MATCH),
    )
    cut = sheet.status[points] == Status.SPLIT
    to = points[cut]
    sheet.warp[to], sheet.level[to] = found["near"][cut], found["near_fit"][cut, 2:4]
    sheet.zncc[to], sheet.iterations[to] = found["near_fit"][cut, 0], found["iterations"][cut]
    sheet.variance[to], sheet.line[to] = variance[cut], found["line"][cut]
    sheet.count[to] = near_n[cut]
    sheet.covariance[to] = found["near_covariance"][cut][:, [0, 7, 1]]
    seen = (cut & far)[:, None]
    for name, value in (("far", found["far"]), ("jump", jump), ("jump_std", jump_std)):
        getattr(sheet, name)[to] = np.where(seen, value, np.nan)[cut]


def _jumps(found: dict[str, np.ndarray], variance: float) -> tuple[np.ndarray, np.ndarray]:
    """Jump (u, v) at the point of the line nearest to the centre, and its deviations across and along the line, px."""
    normal = np.column_stack([np.cos(found["line"][:, 0]), np.sin(found["line"][:, 0])])
    arm = normal * found["line"][:, 1:]
    basis = np.zeros((len(arm), 2, 6))  # displacement at the foot, as a function of the warp
    basis[:, 0, [0, 2, 3]] = basis[:, 1, [1, 4, 5]] = np.column_stack([np.ones(len(arm)), arm])
    jump = np.einsum("nij,nj->ni", basis, found["far"] - found["near"])
    both = (found["near_covariance"] + found["far_covariance"]).reshape(-1, 6, 6)
    spread = variance * basis @ both @ basis.transpose(0, 2, 1)
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    std = [np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", d, spread, d), 0)) for d in (normal, along)]
    return jump, np.column_stack(std)
