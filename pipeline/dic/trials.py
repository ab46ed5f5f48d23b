"""What a long test asks of the correlation, measured: large motion, many frames in bounded memory, changing light."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.core.errors import ConvergenceError
from pipeline.dic.benchmark import Row, count
from pipeline.dic.correlate import correlate
from pipeline.dic.correlation import Correlation
from pipeline.dic.motion import Affine, Motion, truth
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Speckle, photograph, photograph_pair
from pipeline.dic.track import track

_SHIFT, _TURN = (60.0, -25.0), 0.02  # px, rad


def _kept(result: Correlation, motion: Motion, shape: tuple[int, int]) -> tuple[float, float]:
    """Share of the points that are still in the picture and have a result, and rms error, px."""
    moved = result.points + truth(motion, result.points)
    inside = np.all((moved > 15) & (moved < np.array(shape[::-1]) - 16), axis=1)
    off = result.displacement - truth(motion, result.points)
    return float(result.valid[inside].mean()), float(np.sqrt(np.nanmean(off**2)))


def large_motion(size: int = 600) -> Iterator[Row]:
    """60 px and 0.02 rad between two pictures."""
    motion = Affine.rigid(_SHIFT, _TURN, (size / 2, size / 2))
    pair = photograph_pair(motion, (size, size), 7)
    share, rms = _kept(correlate(pair.reference, pair.deformed, Settings(threads=1)), motion, (size, size))
    yield Row("60 px and 0.02 rad at once: points kept", share, "≥ 0.99", share >= 0.99)
    yield Row("60 px and 0.02 rad at once: rms, px", rms, "", None)


def series(frames: int, shape: tuple[int, int] = (1000, 1300)) -> Iterator[Row]:
    """The same motion in so many frames: what is lost on the way, and how much memory is held while it lasts."""
    speckle, camera = Speckle.scattered(shape, np.random.default_rng(0)), Camera()

    def motion(k: int) -> Affine:
        share = k / max(frames - 1, 1)
        return Affine.rigid((_SHIFT[0] * share, _SHIFT[1] * share), _TURN * share, (shape[1] / 2, shape[0] / 2))

    pictures = (photograph(speckle, shape, motion(k), camera, np.random.default_rng(k)) for k in range(frames))
    memory, share, rms = [], 0.0, 0.0
    for k, result in enumerate(track(pictures, Settings(grid_step_px=12, threads=1)), start=1):
        share, rms = _kept(result, motion(k), shape)
        memory.append(_resident())
    early, late = max(memory[: len(memory) // 4 + 1]), max(memory)
    yield Row(f"{frames} frames to 60 px and 0.02 rad: points kept", share, "≥ 0.99", share >= 0.99)
    yield Row(f"{frames} frames: rms of the last, px", rms, "", None)
    yield Row(f"{frames} frames of {shape[1]} × {shape[0]} px: memory held, MB", late, "", None)
    yield Row(f"{frames} frames: of it gained after the first quarter, MB", late - early, "≤ 20", late - early <= 20)


def _resident() -> float:
    """Memory of this process now, MB (proc(5))."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def light(gains: tuple[float, ...] = (1.5, 2.0, 3.0, 6.0), size: int = 300) -> Iterator[Row]:
    """Cameras with so much light that up to half of the speckle is saturated, in both pictures or in the later."""
    motion = Affine((1.3, -0.7), ((1e-3, 0.0), (0.0, 2e-3)), (size / 2, size / 2))
    points, wrong, refused, pairs = 0, 0, 0, 0
    for before in (1.0, *gains):
        for after in gains:
            pair = photograph_pair(motion, (size, size), 5, Camera(gain=before), Camera(gain=after))
            pairs += 1
            try:
                found = count(correlate(pair.reference, pair.deformed, Settings(threads=1)), pair)
            except ConvergenceError:
                refused += 1
                continue
            points, wrong = points + int(found.valid.sum()), wrong + int(found.wrong.sum())
    yield Row("saturated pictures: pairs", pairs, "", None)
    yield Row("saturated pictures: pairs refused with the reason", refused, "", None)
    yield Row("saturated pictures: wrong share in the others", wrong / points, "≤ 1e-3", wrong <= 1e-3 * points)
