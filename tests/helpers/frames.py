"""A correlated picture with a straight crack, made of numbers."""

from __future__ import annotations

import numpy as np

from pipeline.dic.correlation import Correlation
from pipeline.dic.crack import Crack
from pipeline.dic.grid import Grid
from pipeline.dic.status import Status
from pipeline.store.correlations import Frame

COLUMN, OPENING, SCALE = 99.5, 3.0, 0.05e-3  # px, px, m/px


def cracked_result(opening: float = OPENING, rows: int = 30) -> Correlation:
    """Two halves that part along the columns by `opening` px; beside the line points are split, on it they fail."""
    grid = Grid(np.arange(15, 190, 6), np.arange(15, 15 + 6 * rows, 6))
    x, n = grid.points[:, 0], grid.size
    side = np.where(x > COLUMN, 0.5, -0.5)
    warp = np.zeros((n, 6))
    warp[:, 0], warp[:, 1], warp[:, 3] = side * opening, -0.25, 1e-3
    split = np.abs(x - COLUMN) < 12
    status = np.where(split, Status.SPLIT, Status.OK).astype(np.uint8)
    status[np.abs(x - COLUMN) < 2.5] = Status.ON_CRACK
    empty = np.full((n, 2), np.nan)
    line, far, jump = empty.copy(), np.full((n, 6), np.nan), empty.copy()
    normal = np.where(side > 0, np.pi, 0.0)
    line[split] = np.column_stack([normal, np.abs(x - COLUMN)])[split]
    far[split] = (warp * [-1, 1, 1, 1, 1, 1])[split]
    jump[split] = np.column_stack([-2 * side * opening, 0 * x])[split]
    return Correlation(
        grid, warp, status, np.full(n, 0.01), np.full(n, 4), np.full((n, 2), 0.01), np.tile([1.0, 0.0], (n, 1)),
        line, far, jump, np.where(split[:, None], [0.02, 0.02], np.nan), 2.5,
    )  # fmt: skip


def straight_crack(opening: float = OPENING, length: int = 20, through: bool = False) -> Crack:
    """From the lower border up, closing linearly towards the tip."""
    arc = 6.0 * np.arange(length)
    path = np.column_stack([np.full(length, COLUMN), 185.0 - arc])
    share = np.ones(length) if through else 1 - np.arange(length) / (length - 1)
    normal = np.tile([1.0, 0.0], (length, 1))
    jump = opening * share
    return Crack(path, arc, normal, jump, 0 * arc, np.full(length, 0.02), jump, path[-1], 3.5, through)


def frame_of(number: int, result: Correlation, crack: bool = True) -> Frame:
    """The result as a frame of a series."""
    return Frame(number, result, straight_crack() if crack else None, number // 2, 0.97, 1.25)
