"""Known motions of a plane: what a rendered photograph shows, to the last digit.

All lengths are pixels, points are (column, row). A motion consists of sheets, pieces that move smoothly; a
sheet's displacement is defined everywhere so that it can be inverted, but only its own points are material.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np


class Motion(Protocol):
    """A displacement field in sheets."""

    @property
    def sheets(self) -> int: ...

    def sheet_of(self, points: np.ndarray) -> np.ndarray:
        """Number of the sheet that each reference point (n, 2) belongs to; (n,) int."""
        ...

    def displacement(self, points: np.ndarray, sheet: np.ndarray) -> np.ndarray:
        """Displacement (n, 2) of reference points, each as a part of the given sheet (n,)."""
        ...


@runtime_checkable
class Seen(Protocol):
    """A motion that knows by itself which material point is seen at each place of a raster."""

    def origin_on(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Material points (rows·columns, 2), row by row, and whether there is any (rows·columns,) bool."""
        ...


@dataclass(frozen=True)
class Affine:
    """x' = x + shift + G (x − centre).

    Parameters
    ----------
    shift : (u, v), px
    gradient : ((u_x, u_y), (v_x, v_y))
    centre : (column, row), px
    """

    shift: tuple[float, float] = (0.0, 0.0)
    gradient: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))
    centre: tuple[float, float] = (0.0, 0.0)
    sheets: int = field(default=1, init=False)

    @classmethod
    def rigid(cls, shift: tuple[float, float], angle: float, centre: tuple[float, float]) -> Affine:
        """A translation and a rotation by `angle` (rad, from the column axis towards the row axis)."""
        c, s = np.cos(angle), np.sin(angle)
        return cls(shift, ((c - 1, -s), (s, c - 1)), centre)

    @classmethod
    def magnified(cls, factor: float, centre: tuple[float, float]) -> Affine:
        """A change of scale, as motion towards the camera gives."""
        return cls((0.0, 0.0), ((factor - 1, 0.0), (0.0, factor - 1)), centre)

    def sheet_of(self, points: np.ndarray) -> np.ndarray:
        return np.zeros(len(points), int)

    def displacement(self, points: np.ndarray, sheet: np.ndarray) -> np.ndarray:
        return np.asarray(self.shift) + (points - np.asarray(self.centre)) @ np.asarray(self.gradient).T


@dataclass(frozen=True)
class Smooth:
    """Any smooth displacement, given as a function of points (n, 2) that returns (n, 2)."""

    function: Callable[[np.ndarray], np.ndarray]
    sheets: int = field(default=1, init=False)

    def sheet_of(self, points: np.ndarray) -> np.ndarray:
        return np.zeros(len(points), int)

    def displacement(self, points: np.ndarray, sheet: np.ndarray) -> np.ndarray:
        return self.function(points)


@dataclass(frozen=True)
class Cut:
    """One crack η = course(ξ) in its own axes, ξ along the crack from the tip, material cracked at ξ > 0.

    Points with η > course(ξ) move by `jump` × profile(ξ) against those below; the profile is 0 for ξ ≤ 0.

    Parameters
    ----------
    tip : (column, row), px; origin of the axes
    angle : rad; direction of ξ, from the column axis towards the row axis; η is a quarter turn further
    jump : (opening, sliding), px; along η and along ξ
    profile : ξ (n,) → share of the jump (n,)
    course : ξ (n,) → η (n,), px
    """

    tip: tuple[float, float]
    angle: float
    jump: tuple[float, float]
    profile: Callable[[np.ndarray], np.ndarray]
    course: Callable[[np.ndarray], np.ndarray] = np.zeros_like

    def local(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """ξ and η of points (n, 2)."""
        arm = points - np.asarray(self.tip)
        c, s = np.cos(self.angle), np.sin(self.angle)
        return arm @ np.array([c, s]), arm @ np.array([-s, c])

    def side(self, points: np.ndarray) -> np.ndarray:
        """1 above the crack and its extension, 0 below; (n,) int."""
        xi, eta = self.local(points)
        return (eta > self.course(xi)).astype(int)

    def opened(self, points: np.ndarray) -> np.ndarray:
        """The jump (n, 2) as it would be at the points."""
        xi, _ = self.local(points)
        c, s = np.cos(self.angle), np.sin(self.angle)
        opening, sliding = self.jump
        direction = opening * np.array([-s, c]) + sliding * np.array([c, s])
        return np.where(xi > 0, self.profile(np.maximum(xi, 0)), 0.0)[:, None] * direction

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) from points to the cracked part, px; course sampled every 0.5 px."""
        from scipy.spatial import cKDTree

        return cKDTree(self.trace(4000.0)).query(points)[0]

    def trace(self, length: float, step: float = 0.5) -> np.ndarray:
        """Points (k, 2) of the crack from its tip on."""
        xi = np.arange(0, length, step)
        eta = self.course(xi)
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.column_stack([self.tip[0] + c * xi - s * eta, self.tip[1] + s * xi + c * eta])


@dataclass(frozen=True)
class Cracked:
    """A smooth motion, broken by cuts; each cut moves its two sides apart symmetrically.

    The sheet number has one bit a cut, set above it.
    """

    cuts: tuple[Cut, ...]
    smooth: Motion = field(default_factory=Affine)

    @property
    def sheets(self) -> int:
        return 2 ** len(self.cuts)

    def sheet_of(self, points: np.ndarray) -> np.ndarray:
        return sum((cut.side(points) << k for k, cut in enumerate(self.cuts)), np.zeros(len(points), int))

    def displacement(self, points: np.ndarray, sheet: np.ndarray) -> np.ndarray:
        moved = self.smooth.displacement(points, np.zeros(len(points), int))
        for k, cut in enumerate(self.cuts):
            moved = moved + ((sheet >> k & 1) - 0.5)[:, None] * cut.opened(points)
        return moved

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) from points to the nearest cracked line, px."""
        return np.min([cut.distance(points) for cut in self.cuts], axis=0)


def truth(motion: Motion, points: np.ndarray) -> np.ndarray:
    """Displacement (n, 2) of material points, px."""
    return motion.displacement(points, motion.sheet_of(points))


def origin_of(motion: Motion, points: np.ndarray, tolerance: float = 1e-10) -> tuple[np.ndarray, np.ndarray]:
    """The material point now seen at each place.

    Parameters
    ----------
    motion : Motion; displacement gradients below 0.5
    points : (n, 2) array, px; places in the deformed picture
    tolerance : float, px; of the fixed-point iteration X = x − u(X)

    Returns
    -------
    origin : (n, 2) array, px; NaN where no material lies (a gap)
    seen : (n,) bool
    """
    origin, seen = np.full(points.shape, np.nan), np.zeros(len(points), bool)
    for number in range(motion.sheets):
        left = np.flatnonzero(~seen)
        sheet = np.full(left.size, number)
        start = _inverse(motion, points[left], sheet, tolerance)
        own = motion.sheet_of(start) == number
        origin[left[own]], seen[left[own]] = start[own], True
    return origin, seen


def _inverse(motion: Motion, points: np.ndarray, sheet: np.ndarray, tolerance: float) -> np.ndarray:
    origin = points - motion.displacement(points, sheet)
    moving = np.arange(len(points))
    for _ in range(100):
        update = points[moving] - motion.displacement(origin[moving], sheet[moving])
        change = np.abs(update - origin[moving]).max(axis=1, initial=0)
        origin[moving] = update
        moving = moving[change > tolerance]
        if moving.size == 0:
            break
    return origin
