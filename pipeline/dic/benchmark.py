"""The numbers of the correlation, measured: speed, noise against the Cramér–Rao bound, what a crack does to it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter

from pipeline.dic.correlate import correlate
from pipeline.dic.correlation import Correlation
from pipeline.dic.motion import Affine, Cracked
from pipeline.dic.scenes import random_scene, two_cracks
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Pair, crack_pair, expose, smooth_pair

NEAR_PX = 12.0
WRONG_PX = 0.1


@dataclass(frozen=True)
class Row:
    """One line of the table: what was measured, its value, the goal and whether it is met."""

    name: str
    value: float
    goal: str
    met: bool | None

    def __str__(self) -> str:
        mark = {True: "met", False: "MISSED", None: ""}[self.met]
        return f"{self.name:<58}{self.value:>12.5g}   {self.goal:<12}{mark}"


@dataclass(frozen=True)
class Count:
    """Points, valid points and wrong ones (valid, but more than 0.1 px off), near a crack and elsewhere."""

    points: np.ndarray
    valid: np.ndarray
    wrong: np.ndarray
    square: np.ndarray

    def __add__(self, other: Count) -> Count:
        return Count(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


def count(result: Correlation, pair: Pair) -> Count:
    """Compare a result with the truth."""
    off = result.displacement - pair.truth(result.points)
    cracked = isinstance(pair.motion, Cracked)
    near = pair.motion.distance(result.points) < NEAR_PX if cracked else np.zeros(len(off), bool)  # type: ignore[attr-defined]
    parts = (near, ~near)
    wrong = result.valid & ~(np.linalg.norm(np.nan_to_num(off), axis=1) <= WRONG_PX)
    return Count(
        np.array([p.sum() for p in parts]),
        np.array([(p & result.valid).sum() for p in parts]),
        np.array([(p & wrong).sum() for p in parts]),
        np.array([np.nansum(off[p] ** 2) / 2 for p in parts]),
    )


def bound(pair: Pair, settings: Settings) -> float:
    """Cramér–Rao bound of a displacement component, px, rms over the grid; noise in both pictures and rounding."""
    clean = expose(pair.speckle, pair.reference.shape, Affine(), replace(pair.camera, noise=0.0))
    row, column = np.gradient(clean)
    variance = 2 * (pair.camera.noise**2 + 1 / 12)
    size = settings.subset_size_px

    def total(values: np.ndarray) -> np.ndarray:
        return uniform_filter(values, size) * size**2

    xx, yy, xy = total(column**2), total(row**2), total(row * column)
    each = variance * np.stack([yy, xx]) / (xx * yy - xy**2)
    return float(np.sqrt(np.mean(each[:, settings.half : -settings.half, settings.half : -settings.half])))


def speed(pair: Pair, settings: Settings, repeat: int = 3) -> tuple[float, Correlation]:
    """Subsets a second of processor time, the best of several runs, and the result."""
    best = np.inf
    for _ in range(repeat):
        start = time.process_time()
        result = correlate(pair.reference, pair.deformed, settings)
        best = min(best, time.process_time() - start)
    return result.grid.size / best, result


def pairs() -> Iterator[Row]:
    """The two pairs of the contract on one core."""
    settings = Settings(threads=1)
    smooth = smooth_pair()
    rate, result = speed(smooth, settings)
    found = count(result, smooth)
    rms, limit = float(np.sqrt(found.square[1] / found.valid[1])), bound(smooth, settings)
    yield Row("smooth: Cramér–Rao bound, px", limit, "", None)
    yield Row("smooth: rms, px", rms, "", None)
    yield Row("smooth: rms / bound", rms / limit, "≤ 1.1", rms <= 1.1 * limit)
    yield Row("smooth: subsets/s/core", rate, "≥ 6000", rate >= 6000)
    yield Row("smooth: wrong share", found.wrong[1] / found.valid[1], "≤ 1e-4", found.wrong[1] <= 1e-4 * found.valid[1])
    crack = crack_pair()
    rate, result = speed(crack, settings)
    found = count(result, crack)
    rms, share = float(np.sqrt(found.square[0] / found.valid[0])), found.valid[0] / found.points[0]
    yield Row("crack: rms within 12 px, px", rms, "≤ 0.03", rms <= 0.03)
    yield Row("crack: valid within 12 px", share, "≥ 0.95", bool(share >= 0.95))
    yield Row(
        "crack: wrong within 12 px", found.wrong[0] / found.valid[0], "≤ 0.01", found.wrong[0] <= 0.01 * found.valid[0]
    )
    yield Row("crack: rms elsewhere, px", float(np.sqrt(found.square[1] / found.valid[1])), "", None)
    yield Row("crack: subsets/s/core", rate, "≥ 2500", rate >= 2500)


def random_cracks(scenes: int, first: int = 0, progress: Callable[[str], None] | None = None) -> Iterator[Row]:
    """Cracks drawn at random."""
    total: Count | None = None
    for seed in range(first, first + scenes):
        scene = random_scene(seed)
        result = correlate(scene.pair.reference, scene.pair.deformed, Settings(threads=1))
        found = count(result, scene.pair)
        total = found if total is None else total + found
        if progress:
            progress(f"{seed} {scene.kind} opening {scene.opening:.2f} px: wrong {found.wrong}, valid {found.valid}")
    if total is None:
        return
    wrong, valid = total.wrong / np.maximum(total.valid, 1), total.valid / np.maximum(total.points, 1)
    yield Row(f"random cracks ({scenes}): wrong within 12 px", wrong[0], "≤ 0.01", bool(wrong[0] <= 0.01))
    yield Row(f"random cracks ({scenes}): wrong elsewhere", wrong[1], "≤ 1e-4", bool(wrong[1] <= 1e-4))
    yield Row("random cracks: valid within 12 px", valid[0], "", None)
    yield Row("random cracks: valid elsewhere", valid[1], "", None)
    near = float(np.sqrt(total.square[0] / max(total.valid[0], 1)))
    yield Row("random cracks: rms within 12 px, px", near, "", None)


def double_cracks() -> Iterator[Row]:
    """Two cracks in one subset: the points between them cannot be told, and must say so."""
    found = {opening: _double(opening) for opening in (0.5, 1.0, 3.0, 10.0)}
    clear, every = sum(found[k].wrong[0] for k in (1.0, 3.0, 10.0)), sum(c.wrong[0] for c in found.values())
    valid = sum(c.valid[0] for c in found.values())
    yield Row("two cracks in a subset, 1 to 10 px open: wrong points", clear, "0", bool(clear == 0))
    yield Row("two cracks, 0.5 px too: wrong within 12 px", every / valid, "≤ 0.01", bool(every <= 0.01 * valid))


def _double(opening: float) -> Count:
    """What becomes of two parallel cracks so wide open, 4 to 14 px apart."""
    pairs = [two_cracks(distance, opening, 220) for distance in range(4, 15, 2)]
    each = [count(correlate(p.reference, p.deformed, Settings(threads=1)), p) for p in pairs]
    return sum(each[1:], each[0])
