"""Particles, bonds between them, and the phases of the material."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class Phase(IntEnum):
    """What a pixel, a particle or a bond is made of; the first four are the label image's values."""

    OUTSIDE = 0
    MASTIC = 1
    AGGREGATE = 2
    VOID = 3
    INTERFACE = 4  # bonds only: aggregate to mastic
    TOUCHING = 5  # bonds only: between two different stones


@dataclass(frozen=True)
class Particles:
    """Centres of the particles.

    Parameters
    ----------
    position : (n, 2) array, m; specimen coordinates, undeformed
    radius : float, m; half the nominal distance between bonded neighbours
    phase : (n,) uint8 array of `Phase`
    stone : (n,) int32 array; number of the stone a particle belongs to, 0 in the mastic
    """

    position: np.ndarray
    radius: float
    phase: np.ndarray
    stone: np.ndarray

    @property
    def count(self) -> int:
        return len(self.position)


@dataclass(frozen=True)
class Bonds:
    """Bonds between particles.

    Parameters
    ----------
    pairs : (m, 2) int32 array; particle indices, first < second
    phase : (m,) uint8 array of `Phase`
    protected : (m,) bool array; these take no damage (near supports and pins)
    """

    pairs: np.ndarray
    phase: np.ndarray
    protected: np.ndarray

    @property
    def count(self) -> int:
        return len(self.pairs)

    def reference(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Undeformed length (m,) in m and unit direction (m, 2) from first to second particle."""
        vector = position[self.pairs[:, 1]] - position[self.pairs[:, 0]]
        length = np.hypot(vector[:, 0], vector[:, 1])
        return length, vector / length[:, None]
