"""From pixels to the specimen and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError


@dataclass(frozen=True)
class View:
    """Where the camera stood.

    Pixel (0, 0) is the centre of the top-left pixel; x = (column − c₀)·scale, y = −(row − r₀)·scale, then turned
    counter-clockwise; last, for a view of the other face, x becomes −x.

    Parameters
    ----------
    metre_per_px : float, m
    origin_px : (column, row) of the specimen's origin; may lie outside the picture
    rotation : float, rad
    mirror : bool; the other face was photographed
    """

    metre_per_px: float
    origin_px: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    mirror: bool = False

    def __post_init__(self) -> None:
        if not self.metre_per_px > 0:
            raise InputError(f"the scale of a camera must be positive, got {self.metre_per_px:g} m/px")

    def _matrix(self) -> np.ndarray:
        c, s = np.cos(self.rotation), np.sin(self.rotation)
        face = np.diag([-1.0 if self.mirror else 1.0, 1.0])
        return self.metre_per_px * face @ np.array([[c, -s], [s, c]]) @ np.diag([1.0, -1.0])

    def point(self, px: np.ndarray) -> np.ndarray:
        """Specimen coordinates (n, 2) in m of pixels (n, 2)."""
        return (np.asarray(px, float) - np.asarray(self.origin_px)) @ self._matrix().T

    def vector(self, px: np.ndarray) -> np.ndarray:
        """Displacements (n, 2) in m of those in px."""
        return np.asarray(px, float) @ self._matrix().T

    def pixel(self, point: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of specimen coordinates (n, 2) in m."""
        return np.asarray(point, float) @ np.linalg.inv(self._matrix()).T + np.asarray(self.origin_px)

    def pixel_vector(self, vector: np.ndarray) -> np.ndarray:
        """Displacements (n, 2) in px of those in m."""
        return np.asarray(vector, float) @ np.linalg.inv(self._matrix()).T
