"""How an image lies on the specimen: pixels to specimen coordinates and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.specimen import Specimen


@dataclass(frozen=True)
class ImagePlacement:
    """The similarity that takes pixels to specimen coordinates.

    Pixel (0, 0) is the centre of the top-left pixel, columns run right and rows down. With origin
    (c₀, r₀), x = (column − c₀)·p and y = −(row − r₀)·p; then (x, y) is turned by `rotation_deg`,
    counter-clockwise; last, where `mirror` is set, x becomes −x.

    `mirror` is for a photograph of the *other* face: origin and rotation are found in that photograph as
    it is, so that its notch points along +y, and the reflection about the notch line brings left and right
    back to those of the face on which x was defined.

    Parameters
    ----------
    metres_per_px : float, m; the pitch p
    origin_px : (column, row) of the specimen origin; may lie outside the image
    rotation_deg : float, degrees
    mirror : bool
    """

    metres_per_px: float
    origin_px: tuple[float, float] = (0.0, 0.0)
    rotation_deg: float = 0.0
    mirror: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.metres_per_px < np.inf:
            raise InputError(f"mm_per_px = {self.metres_per_px * 1e3:g} must be positive: give the size of a pixel")
        if not np.all(np.isfinite([*self.origin_px, self.rotation_deg])):
            raise InputError(
                f"origin_px = {self.origin_px} and rotation_deg = {self.rotation_deg} must be finite numbers"
            )

    @property
    def turn(self) -> np.ndarray:
        """The (2, 2) matrix that takes (column, −row) directions to specimen directions."""
        angle = np.deg2rad(self.rotation_deg)
        c, s = np.cos(angle), np.sin(angle)
        sign = -1.0 if self.mirror else 1.0
        return np.array([[sign * c, -sign * s], [s, c]])

    def to_specimen(self, pixels: np.ndarray) -> np.ndarray:
        """Specimen coordinates (n, 2) in m of pixel positions (n, 2), each (column, row)."""
        flat = (np.asarray(pixels, float) - self.origin_px) * (self.metres_per_px, -self.metres_per_px)
        return flat @ self.turn.T

    def to_pixel(self, points: np.ndarray) -> np.ndarray:
        """Pixel positions (n, 2), each (column, row), of specimen coordinates (n, 2) in m."""
        flat = np.asarray(points, float) @ self.turn  # the matrix is orthogonal: its inverse is its transpose
        return flat / (self.metres_per_px, -self.metres_per_px) + self.origin_px


def specimen_mask(specimen: Specimen, placement: ImagePlacement, shape: tuple[int, int]) -> np.ndarray:
    """Which pixels of an image of `shape` have their centre in the specimen; (rows, cols) bool."""
    row, column = np.indices(shape)
    return specimen.contains(placement.to_specimen(np.column_stack([column.ravel(), row.ravel()]))).reshape(shape)
