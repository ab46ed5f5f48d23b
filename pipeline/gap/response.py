"""What a simulation says about a test, as functions of the true CMOD: before anything is measured."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

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

    @cached_property
    def _spline(self) -> CubicSpline:
        """Every frame's part in the cubic spline through all of them and rest."""
        knots = np.append(0.0, self.field)
        return CubicSpline(knots, np.eye(knots.size)[:, 1:])

    def frames_to(self, at: np.ndarray) -> np.ndarray:
        """Weights (s, k) of the frames in a field at CMOD values (s,), m.

        A cubic spline through frames and rest; beyond the last frame its last slope is continued: a gauge that reads
        too little looks a little farther than it says.
        """
        last = self.field[-1]
        beyond = np.maximum(at - last, 0.0)
        return self._spline(np.clip(at, 0.0, last)) + beyond[:, None] * self._spline(last, 1)

    def loads_to(self, load: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Loads (s,) at CMOD values (s,), m, along straight lines; beyond the last the last stretch is continued."""
        knots, values = np.append(0.0, self.load), np.append(0.0, load)
        slope = (values[-1] - values[-2]) / (knots[-1] - knots[-2])
        return np.interp(at, knots, values) + np.maximum(at - knots[-1], 0.0) * slope

    def known_at(self, known: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Whether fields (s, p) at CMOD values (s,) rest on frames that are there, from whether those are (k, p)."""
        upper = np.minimum(np.searchsorted(self.field, at * (1 - 1e-9)), self.field.size - 1)
        return np.logical_and.accumulate(known, axis=0)[upper]

    def reached(self, known: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The same for loads: (s,) from (l,)."""
        upper = np.minimum(np.searchsorted(self.load, at * (1 - 1e-9)), self.load.size - 1)
        return np.logical_and.accumulate(known)[upper]


@dataclass(frozen=True, eq=False)
class Response:
    """One simulation at the abscissae.

    Parameters
    ----------
    field : (k, p, 2) array, m; NaN where a point could not be observed
    load : (l,) array, N; NaN where the CMOD was not reached
    """

    field: np.ndarray
    load: np.ndarray

    def flat(self) -> np.ndarray:
        """All numbers, field first; (2kp + l,)."""
        return np.concatenate([self.field.ravel(), self.load])


def split(flat: np.ndarray, abscissae: Abscissae, points: int) -> Response:
    """The inverse of `Response.flat`."""
    cut = 2 * abscissae.field.size * points
    return Response(flat[:cut].reshape(abscissae.field.size, points, 2), flat[cut:])


def continued(values: np.ndarray) -> np.ndarray:
    """Values (k, ...) whose missing last entries repeat the last step, so that a spline stays smooth up to them."""
    found = np.array(values, float)
    for k in range(1, len(found)):
        step = found[k - 1] - found[k - 2] if k > 1 else np.zeros_like(found[0])
        found[k] = np.where(np.isfinite(found[k]), found[k], found[k - 1] + step)
    return np.nan_to_num(found)


def read(response: Response, abscissae: Abscissae, field_at: np.ndarray, load_at: np.ndarray) -> Reading:
    """Field (s, p, 2) and load (s,) of a simulation at true CMOD values (s,), m; NaN where it does not reach."""
    known = np.isfinite(response.field.sum(axis=2))
    field = np.tensordot(abscissae.frames_to(field_at), continued(response.field), 1)
    field[~abscissae.known_at(known, field_at)] = np.nan
    load = abscissae.loads_to(continued(response.load), load_at)
    load[~abscissae.reached(np.isfinite(response.load), load_at)] = np.nan
    return Reading(field, load)
