"""Synthetic cut faces: irregular stones graded after Fuller, placed at random without overlap."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.microstructure.stones import SMALLEST_STONE


@dataclass(frozen=True)
class Grading:
    """How much stone of which size a section holds.

    Parameters
    ----------
    area_fraction : float; stones of at least `smallest` in the area of the section
    smallest, largest : float, m; diameters of the circle of equal area
    exponent : float; of Fuller's curve, 0.5 in Fuller and Thompson 1907, 0.45 in Superpave
    gap : float, m; least film of mastic between two stones
    """

    area_fraction: float = 0.45
    smallest: float = SMALLEST_STONE
    largest: float = 9.5e-3
    exponent: float = 0.5
    gap: float = 0.2e-3

    def __post_init__(self) -> None:
        if not 0 < self.area_fraction < 1:
            raise InputError(f"area_fraction = {self.area_fraction:g} of a section must lie between 0 and 1")
        if not (0 < self.smallest < self.largest and self.exponent > 0 and self.gap >= 0):
            raise InputError(
                f"stones from {self.smallest * 1e3:g} to {self.largest * 1e3:g} mm with exponent {self.exponent:g} and "
                f"gap {self.gap * 1e3:g} mm: sizes must rise, exponent be positive, gap not negative"
            )

    def passing(self, diameter: np.ndarray) -> np.ndarray:
        """Share of the stones' area in stones not larger than each diameter (m): Fuller's curve of this range."""
        low, high = self.smallest**self.exponent, self.largest**self.exponent
        return np.clip((np.asarray(diameter, float) ** self.exponent - low) / (high - low), 0, 1)

    def diameter(self, passing: float) -> float:
        """The diameter (m) that a share of the stones' area passes."""
        low, high = self.smallest**self.exponent, self.largest**self.exponent
        return float((low + passing * (high - low)) ** (1 / self.exponent))

    def draw(self, area: float, rng: np.random.Generator) -> np.ndarray:
        """Diameters (k,) in m, falling, of the stones in a section of `area` (m²).

        The curve is walked down from its top; each stone is drawn from the stretch of the curve that its
        own area takes, so that every section follows the curve and no two sections are alike.
        """
        stones, left = self.area_fraction * area, 1.0
        found: list[float] = []
        while True:
            share = np.pi / 4 * self.diameter(left) ** 2 / stones
            chosen = self.diameter(max(left - rng.random() * share, 0.0))
            share = np.pi / 4 * chosen**2 / stones
            if share > 2 * left:
                return np.array(found)
            found.append(chosen)
            left = max(left - share, 0.0)
            if left == 0:
                return np.array(found)


@dataclass(frozen=True)
class Section:
    """A synthetic cut face.

    Parameters
    ----------
    label : (rows, cols) uint8 array; mastic and aggregate of `Phase`
    stone : (rows, cols) int32 array; 1 … in a stone, 0 in the mastic
    diameter : (stones,) array, m; drawn diameters, in the order of the stones' numbers
    metres_per_px : float, m
    """

    label: np.ndarray
    stone: np.ndarray
    diameter: np.ndarray
    metres_per_px: float


def fuller_section(
    width: float, height: float, metres_per_px: float, rng: np.random.Generator, grading: Grading | None = None
) -> Section:
    """A section with stones graded after Fuller, largest placed first, none overlapping.

    The section repeats itself in both directions: a stone that leaves at one edge comes in at the opposite
    one, so that edges cut stones as a saw does and the area fraction holds to one stone and the raster.

    Parameters
    ----------
    width, height : float, m
    metres_per_px : float, m; at least four pixels to the smallest stone
    rng : numpy random generator
    grading : Grading, the default one where not given

    Raises
    ------
    InputError
        if the raster is too coarse, the section too small for its largest stone, or too full to place all
    """
    grading = grading or Grading()
    shape = (round(height / metres_per_px), round(width / metres_per_px))
    _check_size(shape, metres_per_px, grading)
    diameter = grading.draw(shape[0] * shape[1] * metres_per_px**2, rng)
    stone = np.zeros(shape, np.int32)
    for number, size in enumerate(diameter / metres_per_px, 1):
        body, film = _raster(_outline(size, rng), grading.gap / metres_per_px)
        place = _free_place(stone, film, rng)
        if place is None:
            reached = np.count_nonzero(stone) / stone.size
            raise InputError(
                f"no room for stone {number} of {diameter.size} at an area fraction of {reached:.2f}: "
                f"area_fraction = {grading.area_fraction:g} cannot be reached, lower it or the gap"
            )
        row, column = np.nonzero(body)
        stone[(place[0] + row) % shape[0], (place[1] + column) % shape[1]] = number
    label = np.where(stone > 0, np.uint8(Phase.AGGREGATE), np.uint8(Phase.MASTIC))
    return Section(label, stone, diameter, metres_per_px)


def _check_size(shape: tuple[int, int], pitch: float, grading: Grading) -> None:
    if grading.smallest < 4 * pitch:
        raise InputError(
            f"{pitch * 1e3:g} mm/px is too coarse for stones of {grading.smallest * 1e3:g} mm: at least 4 pixels are "
            "needed"
        )
    if min(shape) * pitch < 2 * grading.largest:
        raise InputError(
            f"a section of {shape[1] * pitch * 1e3:g} × {shape[0] * pitch * 1e3:g} mm is too small for stones of "
            f"{grading.largest * 1e3:g} mm: each side must be at least twice as long"
        )


def _outline(size: float, rng: np.random.Generator) -> np.ndarray:
    """A random polygon (k, 2) around the origin whose area is that of a circle of diameter `size`.

    Vertices near an ellipse of random axes (ratio 1 to 1.7), their radii varied by 8 %.
    """
    count = int(rng.integers(7, 13))
    turn = (np.arange(count) + rng.uniform(-0.35, 0.35, count)) * 2 * np.pi / count
    ratio, tilt = rng.uniform(1.0, 1.7), rng.uniform(0, np.pi)
    radius = 1 + rng.uniform(-0.08, 0.08, count)
    x, y = radius * np.cos(turn) * ratio, radius * np.sin(turn)
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    scale = np.sqrt(np.pi / 4 * size**2 / area)
    return scale * np.column_stack([x * np.cos(tilt) - y * np.sin(tilt), x * np.sin(tilt) + y * np.cos(tilt)])


def _raster(outline: np.ndarray, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """The pixels whose centres lie in the polygon, and the same widened by the gap (px); bool images of one size."""
    film = int(np.ceil(gap))
    low = np.floor(outline.min(axis=0)) - film
    columns, rows = (np.ceil(outline.max(axis=0) - low) + film + 1).astype(int)
    x, y = np.meshgrid(np.arange(columns) + low[0], np.arange(rows) + low[1])
    body = _inside(x, y, outline)
    disk = np.hypot(*np.mgrid[-film : film + 1, -film : film + 1]) <= max(gap, 0.5)
    return body, cv2.dilate(body.astype(np.uint8), disk.astype(np.uint8)) > 0


def _inside(x: np.ndarray, y: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Which points lie in a closed polygon (k, 2), by the even–odd rule."""
    inside = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 != y1:
            inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside


def _free_place(
    stone: np.ndarray, film: np.ndarray, rng: np.random.Generator, batches: int = 2000, batch: int = 128
) -> tuple[int, int] | None:
    """A random corner (row, column) at which no pixel of the film lies in another stone; None where none is found.

    Most places are ruled out by a few pixels of the film, all pixels are read only for the rest.
    """
    film_row, film_column = np.nonzero(film)
    few = rng.choice(film_row.size, min(48, film_row.size), replace=False)
    rows, columns = stone.shape
    for _ in range(batches):
        row, column = rng.integers(0, rows, batch), rng.integers(0, columns, batch)
        taken = stone[(row[:, None] + film_row[few]) % rows, (column[:, None] + film_column[few]) % columns] > 0
        for k in np.flatnonzero(~taken.any(axis=1)):
            if not np.any(stone[(row[k] + film_row) % rows, (column[k] + film_column) % columns]):
                return int(row[k]), int(column[k])
    return None
