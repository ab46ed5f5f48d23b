"""What a correlation found at each point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from pipeline.core.field import DisplacementField
from pipeline.dic.camera import View
from pipeline.dic.grid import Grid
from pipeline.dic.status import Status


@dataclass(frozen=True, eq=False)
class Correlation:
    """One picture against its reference; lengths in px, (column, row).

    Parameters
    ----------
    grid : Grid
    warp : (n, 6) array; u, v, u_x, u_y, v_x, v_y of the part that holds the centre
    status : (n,) uint8 array of `Status`
    znssd : (n,) array; 0 best, 2(1 − ZNCC)
    iterations : (n,) int array
    std : (n, 2) array; standard deviation of u and v from image noise and gradients (Cramér–Rao)
    level : (n, 2) array; gain and offset of the grey values
    line : (n, 2) array; angle (rad) of the normal and distance (px) of the line that parts the subset; NaN elsewhere
    far : (n, 6) array; warp of the part beyond the line, as seen from the centre; NaN where there is none
    jump : (n, 2) array; u and v beyond the line minus those on the near side, at the line; NaN elsewhere
    jump_std : (n, 2) array; of the jump's components along the line's normal and along the line
    noise : float, grey values; standard deviation of reference minus matched grey value
    """

    grid: Grid
    warp: np.ndarray
    status: np.ndarray
    znssd: np.ndarray
    iterations: np.ndarray
    std: np.ndarray
    level: np.ndarray
    line: np.ndarray
    far: np.ndarray
    jump: np.ndarray
    jump_std: np.ndarray
    noise: float

    @property
    def points(self) -> np.ndarray:
        return self.grid.points

    @property
    def displacement(self) -> np.ndarray:
        """(n, 2) array, px; NaN where the point failed."""
        return np.where(self.valid[:, None], self.warp[:, :2], np.nan)

    @property
    def gradient(self) -> np.ndarray:
        """(n, 4) array; u_x, u_y, v_x, v_y; NaN where the point failed."""
        return np.where(self.valid[:, None], self.warp[:, 2:], np.nan)

    @cached_property
    def valid(self) -> np.ndarray:
        return self.status <= Status.SPLIT

    @cached_property
    def split(self) -> np.ndarray:
        return self.status == Status.SPLIT

    @property
    def normal(self) -> np.ndarray:
        """(n, 2) unit normals of the lines, from the near to the far side."""
        return np.column_stack([np.cos(self.line[:, 0]), np.sin(self.line[:, 0])])

    @property
    def foot(self) -> np.ndarray:
        """(n, 2) point of each line nearest to the centre, px."""
        return self.points + self.normal * self.line[:, 1:]

    @property
    def opening(self) -> np.ndarray:
        """(n,) jump along the line's normal, px; positive where the sides part."""
        return np.sum(self.jump * self.normal, axis=1)

    @property
    def sliding(self) -> np.ndarray:
        """(n,) jump along the line, px; positive when the far side moves a quarter turn on from the normal."""
        return np.sum(self.jump * np.column_stack([-self.normal[:, 1], self.normal[:, 0]]), axis=1)

    def at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement (k, 2) and its standard deviation (k,), px, at any points (k, 2), and which of them are valid.

        Each takes the warp of the nearest valid subset it lies in; beyond that subset's line, the warp of the far part.
        """
        known = np.flatnonzero(self.valid)
        moved, std = np.full((len(points), 2), np.nan), np.full(len(points), np.nan)
        if not known.size:
            return moved, std, np.zeros(len(points), bool)
        reach = 1.5 * max(np.diff(self.grid.columns[:2]).sum(), np.diff(self.grid.rows[:2]).sum(), 1)
        count = min(6, known.size)
        distance, order = cKDTree(self.points[known]).query(points, k=count)
        for near, node in zip(distance.reshape(-1, count).T, known[order].reshape(-1, count).T, strict=True):
            arm = points - self.points[node]
            beyond = self.split[node] & (np.sum(arm * self.normal[node], axis=1) > self.line[node, 1])
            warp = np.where(beyond[:, None], self.far[node], self.warp[node])
            take = np.isnan(std) & (near <= reach) & np.isfinite(warp[:, 0])
            basis = np.column_stack([np.ones(len(arm)), arm])
            value = np.column_stack([np.sum(basis * warp[:, [0, 2, 3]], 1), np.sum(basis * warp[:, [1, 4, 5]], 1)])
            moved[take], std[take] = value[take], np.sqrt(np.mean(self.std[node[take]] ** 2, axis=1))
        return moved, std, np.isfinite(std)

    def reasons(self) -> dict[str, int]:
        """How many points met each fate, in words."""
        codes, counts = np.unique(self.status, return_counts=True)
        return {Status(int(code)).sentence: int(count) for code, count in zip(codes, counts, strict=True)}

    def field(self, view: View, abscissa: float = 0.0) -> DisplacementField:
        """The displacements in specimen coordinates, m."""
        return field_of([self], view, np.array([abscissa]))


def field_of(series: list[Correlation], view: View, abscissa: np.ndarray) -> DisplacementField:
    """Several correlations on one grid as a displacement field (m, specimen coordinates); `abscissa` (frames,)."""
    moved = [np.where(c.valid[:, None], view.vector(np.nan_to_num(c.warp[:, :2])), np.nan) for c in series]
    return DisplacementField(
        points=view.point(series[0].points),
        displacement=np.array(moved),
        valid=np.array([c.valid for c in series]),
        std=np.array([np.sqrt(np.mean(c.std**2, axis=1)) * view.metre_per_px for c in series]),
        abscissa=np.asarray(abscissa, float),
    )
