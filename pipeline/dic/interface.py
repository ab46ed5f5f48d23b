"""What the compiled core does, in Python: arrays are checked, results named, objects freed with their owners."""

from __future__ import annotations

import ctypes
import weakref
from ctypes import POINTER
from typing import Any

import numpy as np

from pipeline.core.errors import InputError
from pipeline.dic.library import MATCHED, PARTED, PatternStruct, PictureStruct, SettingsStruct, call, library
from pipeline.dic.saturation import Range


def _table(array: np.ndarray, width: int, rule: str, kind: Any = float, length: int | None = None) -> np.ndarray:
    """Rows of so many numbers, without gaps; refuses other shapes with the rule that they break."""
    rows = np.ascontiguousarray(array, kind)
    if rows.ndim != 2 or rows.shape[1] != width or (length is not None and len(rows) != length):
        raise InputError(f"{rule}, got an array of shape {np.shape(array)}")
    return rows


def _points(array: np.ndarray) -> np.ndarray:
    return _table(array, 2, "a point has 2 numbers: column, row")


def _warps(array: np.ndarray, count: int, what: str) -> np.ndarray:
    return _table(array, 6, f"one warp {what}, and a warp has 6 numbers: u, v, u_x, u_y, v_x, v_y", length=count)


def _carried(array: np.ndarray | None, count: int) -> np.ndarray | None:
    return None if array is None else _warps(array, count, "carries a point")


def _named(records: np.ndarray) -> dict[str, np.ndarray]:
    """The fields of records, each an array of its own."""
    return {name: np.ascontiguousarray(records[name]) for name in records.dtype.names or ()}


class Picture:
    """A picture (rows, columns) of grey values, ready to be correlated; its saturated pixels are left out."""

    def __init__(self, grey: np.ndarray) -> None:
        grey = np.ascontiguousarray(grey, np.float32)
        if grey.ndim != 2:
            raise InputError(f"a picture has rows and columns, got an array of shape {grey.shape}")
        self.shape: tuple[int, int] = (grey.shape[0], grey.shape[1])
        self.range = Range.of(grey) if grey.size else Range()
        self._as_parameter_ = POINTER(PictureStruct)()
        call(
            "dic_new_picture",
            grey,
            *grey.shape,
            self.range.floor,
            self.range.ceiling,
            ctypes.byref(self._as_parameter_),
        )
        _freed_with(self, "dic_free_picture")


class Pattern:
    """A speckle pattern: blobs (m, 4) of column, row, sigma (px) and grey value."""

    def __init__(self, blobs: np.ndarray) -> None:
        rows = _table(blobs, 4, "a blob has 4 numbers: column, row, sigma, grey")
        self._as_parameter_ = POINTER(PatternStruct)()
        call("dic_new_pattern", rows, len(rows), ctypes.byref(self._as_parameter_))
        _freed_with(self, "dic_free_pattern")

    def evaluate(self, points: np.ndarray, threads: int = 1) -> np.ndarray:
        """Grey values (n,) float32, without background, at points (n, 2)."""
        points = _points(points)
        grey = np.empty(len(points), np.float32)
        call("dic_evaluate", self, points, len(points), threads, grey)
        return grey


def _freed_with(owner: Picture | Pattern, free: str) -> None:
    """Free what the library holds for its owner; not at the end of the program, when threads may still use it."""
    weakref.finalize(owner, getattr(library(), free), owner._as_parameter_).atexit = False


def propagate(
    reference: Picture,
    current: Picture,
    points: np.ndarray,
    neighbours: np.ndarray,
    seeds: np.ndarray,
    guesses: np.ndarray,
    carried: np.ndarray | None = None,
    **settings: float,
) -> dict[str, np.ndarray]:
    """Match points (n, 2), each from its best neighbour (n, 8), beginning with seeds (k,) and their guesses (k, 6).

    `carried` (n, 6): warps by which the reference has carried the points. Returns the fields of `MATCHED`.
    """
    points, seeds = _points(points), np.ascontiguousarray(seeds, np.int32).ravel()
    neighbours = _table(neighbours, 8, "neighbours are points × 8", np.int32, len(points))
    guesses = _warps(guesses, len(seeds), "guesses a seed")
    found, solver = np.zeros(len(points), MATCHED), SettingsStruct(**settings)
    given = (points, len(points), neighbours, seeds, guesses, len(seeds), _carried(carried, len(points)))
    call("dic_propagate", reference, current, *given, solver, found)
    return _named(found)


def match(
    reference: Picture,
    current: Picture,
    points: np.ndarray,
    guesses: np.ndarray,
    carried: np.ndarray | None = None,
    **settings: float,
) -> dict[str, np.ndarray]:
    """Match points (n, 2), each from its own guess (n, 6); the rest as in `propagate`."""
    points = _points(points)
    guesses = _warps(guesses, len(points), "guesses a point")
    found, solver = np.zeros(len(points), MATCHED), SettingsStruct(**settings)
    call("dic_match", reference, current, points, len(points), guesses, _carried(carried, len(points)), solver, found)
    return _named(found)


def split(
    reference: Picture,
    current: Picture,
    points: np.ndarray,
    candidates: np.ndarray,
    first: np.ndarray,
    variance: float,
    carried: np.ndarray | None = None,
    far_carried: np.ndarray | None = None,
    lines: np.ndarray | None = None,
    **settings: float,
) -> dict[str, np.ndarray]:
    """Cut the subsets of points (n, 2) by a line, each side moving by one of the candidates.

    Rows first[i] to first[i + 1] of `candidates` (k, 10) belong to point i. Where the reference has carried the
    points: the warps (n, 6) of both sides of a line (n, 2) that already cuts them. Returns the fields of `PARTED`.
    """
    points, count = _points(points), len(points)
    candidates = _table(candidates, 10, "candidates are rows of 10 numbers")
    first = np.ascontiguousarray(first, np.int32).ravel()
    if len(first) != count + 1:
        raise InputError(f"{count} points need {count + 1} starts of candidates, got {len(first)}")
    if lines is not None:
        lines = _table(lines, 2, "a line has an angle and an offset, one line a point", length=count)
    known = (_carried(carried, count), _carried(far_carried, count), lines)
    found, solver = np.zeros(count, PARTED), SettingsStruct(**settings)
    pair = (reference, current, points, count)
    call("dic_split", *pair, candidates, len(candidates), first, variance, *known, solver, found)
    return _named(found)


def cover(
    corners: np.ndarray, triangles: np.ndarray, *, column0: float, row0: float, step: float, columns: int, rows: int
) -> np.ndarray:
    """Number of the triangle (k, 3) of corners (m, 2) that covers each node of a raster; (rows, columns) int32."""
    corners = _table(corners, 2, "a corner has 2 numbers: column, row")
    triangles = _table(triangles, 3, "a triangle has 3 corners", np.int32)
    number = np.empty((max(rows, 0), max(columns, 0)), np.int32)
    given = (corners, len(corners), triangles, len(triangles))
    call("dic_cover", *given, column0, row0, step, columns, rows, number)
    return number
