"""Pixels as an image file holds them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError

MAX_PIXELS = 300_000_000  # an image as float32 then stays near 1 GB
MAX_BYTES = 8 * MAX_PIXELS  # of a file: 16 bits of red, green, blue and alpha


@dataclass(frozen=True)
class Raster:
    """Decoded pixels.

    Parameters
    ----------
    pixels : (rows, columns) or (rows, columns, 3 or 4) array; colours in the order red, green, blue
    palette : (k, 3) array or None; the colours that the numbers in `pixels` stand for
    """

    pixels: np.ndarray
    palette: np.ndarray | None = None

    def coloured(self) -> np.ndarray:
        """The pixels with palette numbers replaced by their colours."""
        return self.pixels if self.palette is None else self.palette[self.pixels]


def within_limit(rows: int, columns: int) -> tuple[int, int]:
    """Rows and columns; refuses an image without pixels and one too large to be held."""
    if rows * columns == 0:
        raise InputError(f"has {columns} × {rows} pixels: an image needs at least one")
    if rows * columns > MAX_PIXELS:
        raise InputError(f"has {columns} × {rows} pixels, the limit is {MAX_PIXELS:,}: crop it or scale it down")
    return rows, columns
