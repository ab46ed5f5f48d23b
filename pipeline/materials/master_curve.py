"""Master curves: measurements at several temperatures laid on one another by shifts in time.

A thermorheologically simple material at temperature T is itself at the reference with every time multiplied
by a_T. The shifts log₁₀ a_T are free, one a temperature; the curve they are shifted onto is a non-negative
series (`series_fit`), so it is admissible and has no order to choose. Shifts and series are found together
(variable projection, Golub and Pereyra 1973).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from pipeline.core.errors import InputError
from pipeline.materials.residuals import inflation
from pipeline.materials.series_fit import creep_design, dynamic_system, not_negative, refuse_data, spaced_times

FEWEST = 3  # readings a temperature
CONFIDENCE = 0.95
STEP = 1e-4  # decades; of the numerical slope, above the round-off of the projection

Residual = Callable[[np.ndarray], np.ndarray]  # of the reduced abscissa


@dataclass(frozen=True)
class MasterCurve:
    """Shifts onto a reference temperature.

    Parameters
    ----------
    temperature : (m,) array, K, increasing
    reference : float, K; one of them
    log_shift : (m,) array; log₁₀ a_T, 0 at the reference
    covariance : (m, m) array; of log_shift, zero rows at the reference
    abscissa : (n,) array; reduced time in s, or reduced angular frequency in rad/s
    rms : float; relative difference between readings and curve
    degrees : int; readings less shifts and terms
    apart : pairs of neighbouring temperatures (K) whose readings do not overlap
    """

    temperature: np.ndarray
    reference: float
    log_shift: np.ndarray
    covariance: np.ndarray
    abscissa: np.ndarray
    rms: float
    degrees: int
    apart: tuple[tuple[float, float], ...]

    @property
    def interval(self) -> np.ndarray:
        """95 % interval (m, 2) of each log_shift."""
        half = student.ppf((1 + CONFIDENCE) / 2, max(self.degrees, 1)) * np.sqrt(np.diag(self.covariance))
        return np.column_stack([self.log_shift - half, self.log_shift + half])


def creep_master_curve(
    time: np.ndarray, compliance: np.ndarray, temperature: np.ndarray, reference: float
) -> MasterCurve:
    """Shift creep compliances onto one another; reduced time is t/a_T.

    Parameters
    ----------
    time : (n,) array, s
    compliance : (n,) array, 1/Pa
    temperature : (n,) array, K; two different ones at least, three readings each
    reference : float, K; one of them
    """
    refuse_data(time, compliance, "compliance", "1/Pa")

    def rest(reduced: np.ndarray, terms: np.ndarray) -> tuple[np.ndarray, int]:
        design = creep_design(reduced, terms, True) / compliance[:, None]
        return _rest(design, np.ones_like(compliance))

    return _shifted(time, compliance, np.asarray(temperature, float), reference, -1.0, rest)


def dynamic_master_curve(
    frequency: np.ndarray, modulus: np.ndarray, temperature: np.ndarray, reference: float
) -> MasterCurve:
    """Shift complex moduli onto one another; reduced frequency is ω a_T.

    Parameters
    ----------
    frequency : (n,) array, rad/s
    modulus : (n,) complex array, Pa
    temperature : (n,) array, K
    reference : float, K; one of them
    """
    refuse_data(frequency, np.abs(modulus), "modulus", "Pa", "frequency", "rad/s")

    def rest(reduced: np.ndarray, terms: np.ndarray) -> tuple[np.ndarray, int]:
        return _rest(*dynamic_system(reduced, modulus, 1 / terms, False))

    return _shifted(frequency, np.abs(modulus), np.asarray(temperature, float), reference, 1.0, rest)


def _shifted(
    x: np.ndarray,
    y: np.ndarray,
    temperature: np.ndarray,
    reference: float,
    sign: float,
    rest: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, int]],
) -> MasterCurve:
    """Shifts for which x a_T^sign gives one curve: first pair by pair, then all together."""
    levels, group = np.unique(temperature, return_inverse=True)
    _refuse_levels(levels, group, reference)
    zero = int(np.searchsorted(levels, reference))
    curves = [(np.log10(x[group == k]), np.log10(y[group == k])) for k in range(levels.size)]
    steps = [_step(a, b) for a, b in pairwise(curves)]
    rough = sign * np.concatenate([[0.0], np.cumsum([step for step, _ in steps])])
    rough = rough - rough[zero]
    first = x * 10 ** (sign * rough[group])
    terms = spaced_times(first.min() / 10, first.max() * 10)
    free = np.arange(levels.size) != zero

    def whole(shift: np.ndarray) -> np.ndarray:
        full = np.zeros(levels.size)
        full[free] = shift
        return full

    def residual(shift: np.ndarray) -> np.ndarray:
        return rest(x * 10 ** (sign * whole(shift)[group]), terms)[0]

    found = least_squares(residual, rough[free], diff_step=STEP, x_scale=1.0, xtol=1e-9, ftol=1e-12)
    shift = whole(found.x)
    left, active = rest(x * 10 ** (sign * shift[group]), terms)
    degrees = max(left.size - active - int(free.sum()), 1)
    covariance = np.zeros((levels.size, levels.size))
    covariance[np.ix_(free, free)] = _covariance(residual, found.x, left, group, degrees)
    apart = tuple((float(a), float(b)) for (a, b), (_, gap) in zip(pairwise(levels), steps, strict=True) if gap)
    rms = float(np.sqrt(np.sum(left**2) / x.size))
    return MasterCurve(
        levels, float(reference), shift, covariance, x * 10 ** (sign * shift[group]), rms, degrees, apart
    )


def _rest(design: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, int]:
    """What the best non-negative combination leaves, and how many columns it uses."""
    size = not_negative(design, wanted)
    return design @ size - wanted, int(np.count_nonzero(size))


def _covariance(residual: Residual, shift: np.ndarray, left: np.ndarray, group: np.ndarray, degrees: int) -> np.ndarray:
    """c s² (JᵀJ)⁻¹ with J the slope of what the projection leaves, c the inflation by correlated neighbours."""
    slope = np.column_stack(
        [(residual(shift + STEP * e) - residual(shift - STEP * e)) / (2 * STEP) for e in np.eye(shift.size)]
    )
    parts = np.tile(group, left.size // group.size) + (np.arange(left.size) // group.size) * (group.max() + 1)
    factor = float(np.mean([inflation(left[parts == k]) for k in np.unique(parts)]))
    return factor * float(left @ left) / degrees * np.linalg.pinv(slope.T @ slope)


def _step(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> tuple[float, bool]:
    """log₁₀ x of the first less that of the second at equal values, and whether they have none in common.

    Both are made monotone, and compared over the values they share; where there are none, at the middle of
    the gap, each extended by its own mean slope.
    """
    (u, values), (v, others) = _monotone(*first), _monotone(*second)
    low, high = max(values[0], others[0]), min(values[-1], others[-1])
    at = np.linspace(low, high, 21) if high > low else np.array([(low + high) / 2])
    return float(np.mean(_at(at, values, u) - _at(at, others, v))), not high > low


def _monotone(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A curve over increasing y: its mean at each x, the running maximum of what grows."""
    places, group = np.unique(x, return_inverse=True)
    mean = np.bincount(group, y) / np.bincount(group)
    if mean[-1] < mean[0]:
        places, mean = places[::-1], mean[::-1]
    top = np.maximum.accumulate(mean)
    rising = np.concatenate([[True], np.diff(top) > 1e-12])
    if rising.sum() < 2:
        raise InputError("the readings at one temperature do not change with time: there is nothing to shift them by")
    return places[rising], top[rising]


def _at(value: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """x at given y, beyond the ends with the mean slope."""
    slope = (x[-1] - x[0]) / (y[-1] - y[0])
    beyond = np.where(value < y[0], value - y[0], np.where(value > y[-1], value - y[-1], 0.0))
    return np.interp(value, y, x) + slope * beyond


def _refuse_levels(levels: np.ndarray, group: np.ndarray, reference: float) -> None:
    """Refuse one temperature only, too few readings, or a reference that was not measured."""
    if levels.size < 2:
        raise InputError("a master curve needs readings at two temperatures at least")
    count = np.bincount(group)
    if count.min() < FEWEST:
        poor = levels[int(np.argmin(count))] - 273.15
        raise InputError(f"{count.min()} readings at {poor:g} °C: a master curve needs {FEWEST} at each temperature")
    if reference not in levels:
        known = ", ".join(f"{t - 273.15:g}" for t in levels)
        raise InputError(f"reference temperature {reference - 273.15:g} °C was not measured: there are {known} °C")
