"""Match a picture with its reference, point by point."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from pipeline.core.errors import ConvergenceError
from pipeline.dic.core import core
from pipeline.dic.correlation import Correlation
from pipeline.dic.grey import checked
from pipeline.dic.grid import Grid
from pipeline.dic.noise import MatchNoise, deviation
from pipeline.dic.parting import Match, Sheet, adopt, part
from pipeline.dic.seeds import find
from pipeline.dic.settings import Settings
from pipeline.dic.status import Status

_OTHER_LIGHT = 0.12  # share of the region of interest that may be saturated in one picture only
_ROUNDS = 4  # of seeding: parts that no neighbour reaches get seeds of their own
_SEEDS = 9
_ROUNDING = 1e-9  # share of the grey values' variance that single precision may lose
_UNUSUAL = 3.0  # noisy pictures: points fail only when they scatter so many times more than their like
_OUTCOMES = np.array(
    [*(Status.OK, Status.NOT_CONVERGED, Status.OUTSIDE, Status.NO_CONTRAST, Status.NOT_CONVERGED, Status.SATURATED)]
)


class Reference:
    """The picture that others are matched with, ready to be used many times.

    Parameters
    ----------
    image : (rows, columns) array of grey values
    settings : Settings
    """

    def __init__(self, image: np.ndarray, settings: Settings | None = None) -> None:
        self.settings = settings or Settings()
        self.image = checked(image, "the reference picture")
        self.grid = Grid.over(self.image.shape, self.settings)
        self._picture: Any = core().Picture(self.image)

    def correlate(self, image: np.ndarray, start: Correlation | None = None) -> Correlation:
        """Match a picture.

        Parameters
        ----------
        image : array of the reference's shape
        start : Correlation, optional; of a picture shortly before, taken as the first guess

        Raises
        ------
        InputError
            if the picture cannot be used
        ConvergenceError
            if nothing of the reference is found again
        """
        grey = checked(image, "the deformed picture", like=self.image)
        match = Match(core(), self._picture, core().Picture(grey), self.grid, self.settings)
        return matched(match, self.image, grey, start)


def correlate(reference: np.ndarray, deformed: np.ndarray, settings: Settings | None = None) -> Correlation:
    """Displacements of a grid of points between two pictures, of one size, in grey values."""
    return Reference(reference, settings).correlate(deformed)


def matched(match: Match, reference: np.ndarray, current: np.ndarray, start: Correlation | None) -> Correlation:
    """The whole chain: propagate, learn the noise, cut what one warp does not explain, judge."""
    _same_light(match, reference, current)
    found = _from_start(match, start) if start is not None else _unreached(match.grid.size)
    drift = np.zeros(2) if start is None or not start.valid.any() else np.median(start.warp[start.valid, :2], axis=0)
    rounds = 1 if start is not None and _good(match, found).any() else _ROUNDS
    found = _seeded(match, reference, current, found, drift, rounds)
    good = _good(match, found)
    if good.sum() < max(1, 0.02 * good.size):
        raise ConvergenceError(
            f"only {int(good.sum())} of {good.size} points of the reference{match.reference.range.remark(reference)} "
            f"are found in the picture{match.current.range.remark(current)}: the motion may be larger than "
            f"search_px = {match.settings.search_px}, or the pictures do not show the same speckle"
        )
    noise = MatchNoise.learnt(found["residual"][good], found["count"][good], found["score"][good])
    noise = noise.at_least(_ROUNDING * float(np.median(found["contrast"][good] / found["count"][good])))
    sheet = _sheet(match, found, noise)
    if match.settings.split:
        part(match, sheet, noise)
    else:
        _accept_whole(sheet, found, good, noise)
    return _correlation(match, sheet, noise)


def _same_light(match: Match, reference: np.ndarray, current: np.ndarray) -> None:
    """Refuse a picture of which so much more or less is saturated that its speckle has other shapes."""
    column, row, width, height = match.settings.roi_px or (0, 0, reference.shape[1], reference.shape[0])
    pictures = ((match.reference, reference), (match.current, current))
    before, now = (
        float(np.mean(grey[row : row + height, column : column + width] >= picture.range.ceiling))
        for picture, grey in pictures
    )
    if abs(now - before) > _OTHER_LIGHT:
        raise ConvergenceError(
            f"{now:.0%} of the picture is saturated, of the reference {before:.0%}: light that the camera cannot tell "
            "apart cannot be compared, photograph the whole test with the same, lower exposure"
        )


def _unreached(n: int) -> dict[str, np.ndarray]:
    widths = {"warp": 6, "level": 2, "covariance": 3, "suspect": 4}
    found: dict[str, np.ndarray] = {name: np.zeros((n, k)) for name, k in widths.items()}
    found |= {name: np.zeros(n) for name in ("residual", "contrast", "score", "bend")}
    return found | {
        "zncc": np.full(n, -1.0),
        "outcome": np.full(n, -1, np.int32),
        "iterations": np.zeros(n, np.int32),
        "count": np.zeros(n, np.int32),
    }


def _good(match: Match, found: dict[str, np.ndarray]) -> np.ndarray:
    return (found["outcome"] == 0) & (found["zncc"] > match.settings.accept_zncc)


def _from_start(match: Match, start: Correlation) -> dict[str, np.ndarray]:
    """Every point from its own earlier warp."""
    return match.core.match(
        match.reference,
        match.current,
        match.grid.points,
        np.ascontiguousarray(start.warp),
        match.carried,
        accept=match.settings.accept_zncc,
        **match.settings.solver(),
    )


def _seeded(
    match: Match,
    reference: np.ndarray,
    current: np.ndarray,
    found: dict[str, np.ndarray],
    drift: np.ndarray,
    rounds: int,
) -> dict[str, np.ndarray]:
    """Propagate from seeds until no part of the grid is left that a seed can be found for."""
    hopeless = np.zeros(match.grid.size, bool)
    if match.carried is not None:  # what was lost when the reference was renewed cannot be found again
        hopeless = ~np.isfinite(match.carried[:, 0])
    for _ in range(rounds):
        good = _good(match, found)
        spots = _spots(match.grid, ~good & ~hopeless)
        if not spots.size:
            break
        hopeless[spots] = True
        seeds, guesses = _search(match, reference, current, spots, drift)
        if not seeds.size:
            continue
        fresh = match.core.propagate(
            match.reference,
            match.current,
            match.grid.points,
            np.where(good[match.grid.neighbours], -1, match.grid.neighbours).astype(np.int32),
            seeds,
            guesses,
            match.carried,
            accept=match.settings.accept_zncc,
            **match.settings.solver(),
        )
        better = ~good & ((fresh["zncc"] > found["zncc"]) | ((found["outcome"] < 0) & (fresh["outcome"] >= 0)))
        found = {name: np.where(better.reshape(-1, *[1] * (v.ndim - 1)), fresh[name], v) for name, v in found.items()}
    return found


def _spots(grid: Grid, missing: np.ndarray) -> np.ndarray:
    """Nodes for seeds in the parts of the grid that are missing: spread over the largest, else the middle of each."""
    if missing.all():
        rows, columns = (np.unique((np.linspace(0.2, 0.8, 3) * (n - 1)).astype(int)) for n in grid.shape)
        return np.unique(rows[:, None] * grid.shape[1] + columns)
    label, _ = ndimage.label(missing.reshape(grid.shape), np.ones((3, 3)))
    sizes = np.bincount(label.ravel())[1:]
    large = [k for k in np.argsort(-sizes)[:_SEEDS] if sizes[k] >= 9]
    depth = ndimage.distance_transform_cdt(np.pad(missing.reshape(grid.shape), 1))[1:-1, 1:-1]
    return np.array([np.argmax(np.where(label == k + 1, depth, -1)) for k in large], int)


def _search(
    match: Match, reference: np.ndarray, current: np.ndarray, spots: np.ndarray, drift: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Those spots that are found again, and their warps (k, 6)."""
    half = match.settings.half + 8
    reference, current = match.reference.range.calmed(reference), match.current.range.calmed(current)
    seeds, guesses = [], []
    for spot in spots:
        carried = match.carried[spot] if match.carried is not None else np.zeros(6)
        column, row = match.grid.points[spot] + carried[:2]
        at = (round(column), round(row))
        if not (0 <= at[0] < reference.shape[1] and 0 <= at[1] < reference.shape[0]):
            continue
        place = find(reference, current, at, half, match.settings.search_px, tuple(drift - carried[:2]))
        if place is not None and place.certain:
            seeds.append(spot)
            guesses.append(np.add(carried, (*place.shift, 0, 0, 0, 0)))
    return np.array(seeds, np.int32), np.array(guesses, float).reshape(-1, 6)


def _sheet(match: Match, found: dict[str, np.ndarray], noise: MatchNoise) -> Sheet:
    n = match.grid.size
    status = np.where(found["outcome"] < 0, Status.NOT_REACHED, _OUTCOMES[found["outcome"]])
    status[status == Status.OK] = Status.POOR_MATCH
    if match.carried is not None:
        status[~np.isfinite(match.carried[:, 0])] = Status.NOT_REACHED  # lost when the reference was renewed
    empty = {"line": 2, "far": 6, "jump": 2, "jump_std": 2}
    sheet = Sheet(
        **{
            k: found[k].copy()
            for k in ("warp", "zncc", "iterations", "covariance", "level", "suspect", "bend", "count")
        },
        **{k: np.full((n, width), np.nan) for k, width in empty.items()},
        status=status.astype(np.uint8),
        variance=np.full(n, np.inf),
    )
    adopt(sheet, np.arange(n), found, noise, better=False)
    sheet.variance[~_good(match, found)] = np.inf
    sheet.status[~_good(match, found) & sheet.sound] = Status.POOR_MATCH
    return sheet


def _accept_whole(sheet: Sheet, found: dict[str, np.ndarray], good: np.ndarray, noise: MatchNoise) -> None:
    """Without cuts only the misfit decides."""
    fits = good & (sheet.variance <= noise.limit(found["count"]))
    sheet.status[fits] = Status.OK


def _correlation(match: Match, sheet: Sheet, noise: MatchNoise) -> Correlation:
    variance = np.where(np.isfinite(sheet.variance), np.maximum(sheet.variance, noise.variance), np.nan)
    std = deviation(sheet.covariance[:, :2], sheet.count, variance)
    status = sheet.status.copy()
    largest = std.max(axis=1)
    usual = float(np.median(largest[sheet.sound])) if sheet.sound.any() else 0.0
    status[sheet.sound & ~(largest <= max(match.settings.imprecise_px, _UNUSUAL * usual))] = Status.NO_CONTRAST
    return Correlation(
        grid=match.grid,
        warp=sheet.warp,
        status=status,
        znssd=2 * (1 - sheet.zncc),
        iterations=sheet.iterations,
        std=std,
        level=sheet.level,
        line=sheet.line,
        far=sheet.far,
        jump=sheet.jump,
        jump_std=sheet.jump_std,
        noise=float(np.sqrt(noise.variance)),
    )
