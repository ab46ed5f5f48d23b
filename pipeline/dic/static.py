"""Noise from pictures of a specimen at rest: what the camera really adds, against what the gradients predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.field import rigid_motion
from pipeline.dic.correlate import Reference
from pipeline.dic.settings import Settings


@dataclass(frozen=True)
class StaticNoise:
    """Scatter of the displacements of a specimen at rest, rigid motion taken out.

    Parameters
    ----------
    std : (2,) array, px; of u and of v
    predicted : (2,) array, px; from image noise and gradients (Cramér–Rao)
    drift : (pairs, 2) array, px; mean motion of each picture against the first
    """

    std: np.ndarray
    predicted: np.ndarray
    drift: np.ndarray

    @property
    def factor(self) -> float:
        """By how much the predicted deviations are to be multiplied."""
        return float(np.sqrt(np.sum(self.std**2) / np.sum(self.predicted**2)))


def static_noise(pictures: Sequence[np.ndarray], settings: Settings | None = None) -> StaticNoise:
    """From two or more pictures (rows, columns) taken at rest.

    The first is the reference of all, so the scatter is that of a pair, as in a test.

    Raises
    ------
    InputError
        for fewer than two pictures
    """
    if len(pictures) < 2:
        raise InputError(f"noise needs at least two pictures at rest, got {len(pictures)}")
    reference = Reference(pictures[0], settings)
    found = [reference.correlate(picture) for picture in pictures[1:]]
    scatter = []
    for c in found:
        moved = np.nan_to_num(c.displacement)
        left = (moved - rigid_motion(c.points, moved, c.valid))[c.valid]
        scatter.append((1.4826 * np.median(np.abs(left - np.median(left, axis=0)), axis=0)) ** 2)
    predicted = [np.median(c.std[c.valid] ** 2, axis=0) for c in found]
    drift = np.array([np.mean(c.displacement[c.valid], axis=0) for c in found])
    return StaticNoise(np.sqrt(np.mean(scatter, axis=0)), np.sqrt(np.mean(predicted, axis=0)), drift)
