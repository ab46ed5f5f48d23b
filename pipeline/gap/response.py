"""What a simulation says about a test, as functions of the true CMOD: before anything is measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from pipeline.core.errors import InputError
from pipeline.gap.observation import Reading


@dataclass(frozen=True, eq=False)
class Abscissae:
    """The CMOD values at which every simulation of a diagnosis is kept; rest (CMOD 0) goes without saying.

    Parameters
    ----------
    field : (k,) array, m, increasing, positive; frames
    load : (l,) array, m, increasing, positive
    """

    field: np.ndarray
    load: np.ndarray

    def __post_init__(self) -> None:
        for name, values in (("field", self.field), ("load", self.load)):
            if values.size < 2 or not (np.diff(values, prepend=0.0) > 0).all():
                raise InputError(f"CMOD values of the {name} must be positive, increasing and at least two: {values}")


@dataclass(frozen=True, eq=False)
class Response:
    """One simulation at the abscissae, or several along leading axes.

    Parameters
    ----------
    field : (..., k, p, 2) array, m; NaN where a point could not be observed
    load : (..., l) array, N; NaN where the CMOD was not reached
    """

    field: np.ndarray
    load: np.ndarray

    def flat(self) -> np.ndarray:
        """All numbers of one simulation, field first; (2kp + l,)."""
        return np.concatenate([self.field.ravel(), self.load])


def split(flat: np.ndarray, abscissae: Abscissae, points: int) -> Response:
    """The inverse of `Response.flat`."""
    cut = 2 * abscissae.field.size * points
    return Response(flat[:cut].reshape(abscissae.field.size, points, 2), flat[cut:])


def read(response: Response, abscissae: Abscissae, field_at: np.ndarray, load_at: np.ndarray) -> Reading:
    """Field (s, p, 2) and load (s,) of a simulation at true CMOD values (s,), m.

    Fields are interpolated by monotone cubics (Fritsch and Carlson 1980), which follow the bend before the peak
    without swinging; loads, kept far denser, along straight lines. Beyond the last frame the last stretch is
    continued: a gauge that reads too much looks a little farther than it says.
    """
    knots = np.append(0.0, abscissae.field)
    values = np.concatenate([np.zeros((1, *response.field.shape[1:])), response.field])
    known = np.isfinite(values).all(axis=2)
    field = np.full((field_at.size, *response.field.shape[1:]), np.nan)
    for pattern in np.unique(known, axis=1).T:  # points with the same frames go together
        points = np.flatnonzero((known == pattern[:, None]).all(axis=0))
        if pattern.sum() >= 3:
            field[:, points] = _along(knots[pattern], values[np.ix_(pattern, points)], field_at, bool(pattern[-1]))
    return Reading(field, _straight(abscissae.load, response.load, load_at))


def _along(knots: np.ndarray, values: np.ndarray, at: np.ndarray, whole: bool) -> np.ndarray:
    """Values at `at`, NaN beyond the last knot where the last frames are missing."""
    curve = PchipInterpolator(knots, values, axis=0)
    beyond = np.maximum(at - knots[-1], 0.0)
    slope = (values[-1] - values[-2]) / (knots[-1] - knots[-2])
    found = curve(np.clip(at, 0.0, knots[-1])) + beyond[:, None, None] * slope
    if not whole:
        found[beyond > 1e-9 * knots[-1]] = np.nan
    return found


def _straight(known: np.ndarray, load: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Loads at `at`; beyond the last known one the last stretch is continued."""
    there = np.isfinite(load)
    knots, values = np.append(0.0, known[there]), np.append(0.0, load[there])
    slope = (values[-1] - values[-2]) / (knots[-1] - knots[-2])
    return np.interp(at, knots, values) + np.maximum(at - knots[-1], 0.0) * slope
