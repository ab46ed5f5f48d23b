"""The numbers of the correlation, measured: speed, noise against the Cramér–Rao bound, what a crack does to it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter

from pipeline.dic.correlate import correlate
from pipeline.dic.correlation import Correlation
from pipeline.dic.motion import Affine, Cracked, truth
from pipeline.dic.scenes import random_scene
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Pair, Speckle, crack_pair, expose, photograph, smooth_pair
from pipeline.dic.track import track

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


def series(frames: int, shape: tuple[int, int] = (1000, 1300)) -> Iterator[Row]:
    """Rigid motion to 60 px with a rotation of 0.02 rad, in so many frames; peak memory of the process."""
    import resource

    speckle, camera = Speckle.scattered(shape, np.random.default_rng(0)), Camera()
    settings = Settings(grid_step_px=12, threads=1)

    def motion(k: int) -> Affine:
        share = k / max(frames - 1, 1)
        return Affine.rigid((60 * share, -25 * share), 0.02 * share, (shape[1] / 2, shape[0] / 2))

    def pictures() -> Iterator[np.ndarray]:
        for k in range(frames):
            yield photograph(speckle, shape, motion(k), camera, np.random.default_rng(k))

    off = moved = valid = inside = np.zeros(0)
    for k, result in enumerate(track(pictures(), settings), start=1):
        moved = result.points + truth(motion(k), result.points)
        inside = np.all((moved > 15) & (moved < np.array(shape[::-1]) - 16), axis=1)
        valid, off = result.valid, result.displacement - truth(motion(k), result.points)
    rms = float(np.sqrt(np.nanmean(off**2)))
    kept = float(valid[inside].mean())
    yield Row(f"series of {frames}: kept at 60 px and 0.02 rad", kept, "≥ 0.99", kept >= 0.99)
    yield Row(f"series of {frames}: rms of the last frame, px", rms, "", None)
    yield Row("series: peak memory, MB", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, "", None)
