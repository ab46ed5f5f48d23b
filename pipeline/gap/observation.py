"""What is compared: displacements of material points and machine load at the stations of one test."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pipeline.core.errors import InputError

STAGES = ("pre-peak", "peak", "tail")
PEAK_BEGINS, TAIL_BEGINS = 0.9, 3.0  # CMOD over CMOD at peak


@dataclass(frozen=True, eq=False)
class Sight:
    """Where and when a test is looked at.

    Parameters
    ----------
    cmod : (s,) array, m; stations, as the clip gauge reads them
    time : (s,) array, s; when the record reaches them
    points : (p, 2) array, m
    side : (p,) array; −1 or +1, the crack flank on which a point lies
    tip : (2,) array, m; of the notch
    peak_cmod : float, m; of the measured curve
    centre : (2,) array, m; of the camera's view
    corner : float, m; distance of the corners of the view from its centre
    pull : (2,) array; unit vector along which a yielding fixture lets the specimen go
    end_cmod : float, m; of the whole record
    contacts : (c, 2) array, m; of machine and specimen, for naming regions
    load : (s,) array, N; what the load cell said, NaN where nothing; empty: nothing anywhere
    """

    cmod: np.ndarray
    time: np.ndarray
    points: np.ndarray
    side: np.ndarray
    tip: np.ndarray
    peak_cmod: float
    centre: np.ndarray
    corner: float
    pull: np.ndarray
    end_cmod: float
    contacts: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    load: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if self.time.shape != self.cmod.shape or self.side.shape != self.points.shape[:1]:
            raise InputError(
                f"a sight has {self.cmod.size} stations with {self.time.size} times and {len(self.points)} points with "
                f"{self.side.size} sides: there must be as many"
            )
        if self.load.size not in (0, self.cmod.size):
            raise InputError(f"a sight of {self.cmod.size} stations has {self.load.size} loads: there must be as many")
        if not (self.peak_cmod > 0 and self.corner > 0):
            raise InputError(
                f"peak_cmod = {self.peak_cmod:g} m and corner = {self.corner:g} m of a sight must be positive"
            )

    @property
    def progress(self) -> np.ndarray:
        """CMOD over the CMOD at peak; (s,)."""
        return self.cmod / self.peak_cmod

    @property
    def stage(self) -> np.ndarray:
        """Number of the stage in `STAGES` of every station; (s,) int."""
        return np.digitize(self.progress, [PEAK_BEGINS, TAIL_BEGINS])


@dataclass(frozen=True, eq=False)
class Reading:
    """What camera and load cell say at the stations; NaN where nothing is known.

    Parameters
    ----------
    field : (s, p, 2) array, m
    load : (s,) array, N
    """

    field: np.ndarray
    load: np.ndarray

    def __sub__(self, other: Reading) -> Reading:
        return Reading(self.field - other.field, self.load - other.load)

    def flat(self) -> np.ndarray:
        """All numbers, field first; (2sp + s,)."""
        return np.concatenate([self.field.ravel(), self.load])


@dataclass(frozen=True, eq=False)
class Observation:
    """A measured test with its noise; what is missing (NaN) in reading or noise is left out.

    Parameters
    ----------
    sight : Sight
    reading : Reading
    field_std : (s, p) array, m; of one displacement component
    load_std : (s,) array, N
    """

    sight: Sight
    reading: Reading
    field_std: np.ndarray
    load_std: np.ndarray

    def __post_init__(self) -> None:
        s, p = self.sight.cmod.size, len(self.sight.points)
        shapes = self.reading.field.shape, self.reading.load.shape, self.field_std.shape, self.load_std.shape
        if shapes != ((s, p, 2), (s,), (s, p), (s,)):
            raise InputError(f"an observation of {s} stations and {p} points has arrays of shapes {shapes}")
        if not self.mask.any():
            raise InputError("nothing was measured: neither a displacement nor a load is left to be compared")
        if not (self.noise[self.mask] > 0).all():
            raise InputError("exact data cannot be weighed: give displacement_std_mm and load_std_n above zero")

    @cached_property
    def noise(self) -> np.ndarray:
        """Variance of the white noise of every number of `Reading.flat`."""
        return np.concatenate([np.repeat(self.field_std.ravel() ** 2, 2), self.load_std**2])

    @cached_property
    def mask(self) -> np.ndarray:
        """Which numbers of `Reading.flat` are there; both components of a point or none."""
        whole = np.isfinite(self.reading.field.sum(axis=2) + self.field_std)
        load = np.isfinite(self.reading.load) & np.isfinite(self.load_std)
        return np.concatenate([np.repeat(whole.ravel(), 2), load])

    @property
    def has_field(self) -> bool:
        return bool(self.mask[: self.reading.field.size].any())

    @property
    def has_load(self) -> bool:
        return bool(self.mask[self.reading.field.size :].any())

    @property
    def load_scale(self) -> float:
        """The largest load (N) at the stations: what relative discrepancies of the load refer to; 1 without load."""
        known = self.mask[self.reading.field.size :]
        return float(np.abs(self.reading.load[known]).max()) if known.any() else 1.0

    def only(self, mask: np.ndarray) -> Observation:
        """The same without the numbers outside `mask` (2sp + s,) bool."""
        s, p, _ = self.reading.field.shape
        field = np.where(mask[: 2 * s * p : 2].reshape(s, p, 1), self.reading.field, np.nan)
        load = np.where(mask[2 * s * p :], self.reading.load, np.nan)
        return Observation(self.sight, Reading(field, load), self.field_std, self.load_std)
