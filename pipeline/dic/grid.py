"""The points that are measured: a square grid of whole pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.core.errors import InputError
from pipeline.dic.settings import Settings


@dataclass(frozen=True, eq=False)
class Grid:
    """Nodes of a grid.

    Parameters
    ----------
    columns : (nc,) int array, px
    rows : (nr,) int array, px
    """

    columns: np.ndarray
    rows: np.ndarray

    @classmethod
    def over(cls, shape: tuple[int, int], settings: Settings) -> Grid:
        """The nodes whose subset, with one pixel to spare, lies in a picture of `shape` (rows, columns)."""
        column, row, width, height = settings.roi_px or (0, 0, shape[1], shape[0])
        if column < 0 or row < 0 or width < 1 or height < 1 or column + width > shape[1] or row + height > shape[0]:
            raise InputError(
                f"roi_px {(column, row, width, height)} (column, row, width, height) reaches outside the picture of "
                f"{shape[1]} × {shape[0]} px: shrink it"
            )
        margin, step = settings.half + 3, settings.grid_step_px
        columns = np.arange(max(column, margin), min(column + width, shape[1] - margin), step)
        rows = np.arange(max(row, margin), min(row + height, shape[0] - margin), step)
        if not columns.size or not rows.size:
            raise InputError(
                f"no subset of {settings.subset_size_px} px fits into the region of interest of {width} × {height} px: "
                "use a larger region or a smaller subset"
            )
        return cls(columns, rows)

    @property
    def shape(self) -> tuple[int, int]:
        return self.rows.size, self.columns.size

    @property
    def size(self) -> int:
        return self.rows.size * self.columns.size

    @cached_property
    def points(self) -> np.ndarray:
        """(n, 2) float array of column, row; row by row."""
        column, row = np.meshgrid(self.columns, self.rows)
        return np.column_stack([column.ravel(), row.ravel()]).astype(float)

    @cached_property
    def neighbours(self) -> np.ndarray:
        """(n, 8) int32 array; −1 beyond the border."""
        offsets = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c]
        return np.ascontiguousarray(np.column_stack([self.shifted(r, c) for r, c in offsets]), np.int32)

    def shifted(self, rows: int, columns: int, of: np.ndarray | None = None) -> np.ndarray:
        """Index of the node so many nodes away from each node (or from those in `of`); −1 beyond the border."""
        node = np.arange(self.size) if of is None else of
        row, column = node // self.columns.size + rows, node % self.columns.size + columns
        inside = (row >= 0) & (row < self.rows.size) & (column >= 0) & (column < self.columns.size)
        return np.where(inside, row * self.columns.size + column, -1)
