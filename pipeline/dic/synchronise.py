"""How late the camera's clock is against the load record, from the opening that both have seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, InputError


@dataclass(frozen=True)
class Synchronisation:
    """The offset of the frames.

    Parameters
    ----------
    offset : float, s; a frame stamped t shows the specimen at record time t − offset (positive: frames are late)
    std : float, s
    gain : float; opening seen by the camera over opening in the record
    zero : float, m; opening seen by the camera when the record shows none
    rms : float, m; of what is left
    frames : int; how many frames were compared
    """

    offset: float
    std: float
    gain: float
    zero: float
    rms: float
    frames: int


def synchronise(
    time: np.ndarray,
    opening: np.ndarray,
    record: LoadCurve,
    *,
    reach: float | None = None,
    fit_gain: bool = False,
    fit_bending: bool = False,
) -> Synchronisation:
    """Shift the frames until the opening they show lies on the record's CMOD.

    The opening seen is modelled as gain × CMOD(t − offset) + bending × load(t − offset) + zero and fitted by least
    squares; a ramp alone cannot tell an offset from a zero, so first motion or a change of rate must be in both (a
    record that begins with the motion will do: before it the specimen is taken to be at rest). The
    error comes from the curvature of the sum of squares, with what is left taken as correlated over neighbouring
    frames.

    Parameters
    ----------
    time : (n,) array, s; stamps of the frames
    opening : (n,) array, m; opening across the notch seen by the camera
    record : LoadCurve
    reach : float, s, optional; largest offset looked for, a third of the shorter span unless given
    fit_gain : bool; also fit the gain (clip gauge and camera do not span the same points)
    fit_bending : bool; also fit a part that follows the load (what lies between those points bends)

    Raises
    ------
    InputError
        for too few frames, or frames and record that do not overlap
    ConvergenceError
        if the offset cannot be told from a zero, or lies at the end of the reach
    """
    time, opening = np.asarray(time, float), np.asarray(opening, float)
    use = np.isfinite(opening)
    time, opening = time[use], opening[use]
    if time.size < 8:
        raise InputError(f"only {time.size} frames have an opening, at least 8 are needed to synchronise")
    span = min(np.ptp(time), np.ptp(record.time))
    reach = span / 3 if reach is None else reach
    trial = np.linspace(-reach, reach, 401)
    fit = _Fit(time, opening, record, fit_gain, fit_bending)
    cost = np.array([fit.at(o)[0] for o in trial])
    if not np.isfinite(cost).any():
        raise InputError(
            f"frames ({time[0]:g} to {time[-1]:g} s) and record ({record.time[0]:g} to {record.time[-1]:g} s) do not "
            f"overlap within ±{reach:g} s: check the clocks"
        )
    best = int(np.nanargmin(np.where(np.isfinite(cost), cost, np.nan)))
    step = trial[1] - trial[0]
    found = minimize_scalar(
        lambda o: fit.at(o)[0],
        bounds=(trial[best] - step, trial[best] + step),
        method="bounded",
        options={"xatol": 1e-6 * step},
    )
    offset = float(found.x)
    if abs(offset) > reach - step:
        raise ConvergenceError(
            f"no offset within ±{reach:.3g} s brings the opening that is seen onto the CMOD: the clocks are further "
            "apart, or the scale or origin of the camera is wrong"
        )
    _, left, slope, basis, (gain, zero) = fit.at(offset)
    std = _error(left, slope, basis)
    if std > reach:
        raise ConvergenceError(
            "the offset cannot be told from a shift of the opening: the frames show neither the first motion nor a "
            "change of rate"
        )
    return Synchronisation(offset, std, gain, zero, float(np.sqrt(np.mean(left**2))), left.size)


@dataclass(frozen=True, eq=False)
class _Fit:
    """What is seen against what is recorded, at any offset; arguments as of `synchronise`."""

    time: np.ndarray
    opening: np.ndarray
    record: LoadCurve
    fit_gain: bool
    fit_bending: bool

    def at(self, offset: float) -> tuple[float, np.ndarray, np.ndarray, np.ndarray, tuple[float, float]]:
        """Mean square, what is left, d(opening)/d(offset), what else is fitted, (gain, zero); infinite where fewer
        than eight frames fall into the record or more than half behind it."""
        record, at = self.record, self.time - offset
        used = at <= record.time[-1]  # before the record begins the specimen rests, and shows what it showed at first
        overlap = used & (at >= record.time[0])
        if overlap.sum() < 8 or used.sum() < 0.5 * self.time.size:
            return np.inf, np.zeros(0), np.zeros(0), np.zeros((0, 1)), (1.0, 0.0)
        cmod, cmod_rate = self._read(record.cmod, at[used])
        load, load_rate = self._read(record.load / np.abs(record.load).max(), at[used])
        columns = [np.ones_like(cmod), *([cmod] if self.fit_gain else []), *([load] if self.fit_bending else [])]
        basis = np.column_stack(columns)
        wanted = self.opening[used] - (0.0 if self.fit_gain else cmod)
        value = np.linalg.lstsq(basis, wanted, rcond=None)[0]
        left = wanted - basis @ value
        gain = float(value[1]) if self.fit_gain else 1.0
        slope = -gain * cmod_rate - (value[-1] * load_rate if self.fit_bending else 0.0)
        return float(np.mean(left**2)), left, slope, basis, (gain, float(value[0]))

    def _read(self, signal: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A signal of the record and its rate at times (s), the rate over the distance of two frames."""
        half = 0.5 * float(np.median(np.diff(self.time)))
        before, now, after = (np.interp(at + s * half, self.record.time, signal) for s in (-1, 0, 1))
        return now, (after - before) / (2 * half)


def _error(left: np.ndarray, slope: np.ndarray, basis: np.ndarray) -> float:
    """Standard deviation of the offset; what else is fitted is projected out, correlation widens it."""
    own = slope - basis @ np.linalg.lstsq(basis, slope, rcond=None)[0]
    variance = float(left @ left) / max(left.size - basis.shape[1] - 1, 1)
    near = float(left[1:] @ left[:-1]) / max(float(left @ left), 1e-300)
    wider = (1 + max(near, 0.0)) / max(1 - max(near, 0.0), 0.05)
    information = float(own @ own)
    return float(np.sqrt(variance * wider / information)) if information > 0 else float("inf")


def first_motion(time: np.ndarray, signal: np.ndarray) -> tuple[float, float]:
    """When a signal at rest begins to move: the kink of a level and a ramp, and its standard deviation, s.

    Parameters
    ----------
    time : (n,) array, s
    signal : (n,) array; at rest first, then growing linearly for a while

    Raises
    ------
    ConvergenceError
        if no motion stands out of the noise
    """
    time, signal = np.asarray(time, float), np.asarray(signal, float)

    def fit(kink: float) -> tuple[float, np.ndarray]:
        basis = np.column_stack([np.ones_like(time), np.maximum(time - kink, 0)])
        value = np.linalg.lstsq(basis, signal, rcond=None)[0]
        return float(np.sum((signal - basis @ value) ** 2)), value

    trial = time[1:-2]
    costs = np.array([fit(k)[0] for k in trial])
    best = int(np.argmin(costs))
    low, high = trial[max(best - 1, 0)], trial[min(best + 1, trial.size - 1)]
    found = minimize_scalar(lambda k: fit(k)[0], bounds=(low, high), method="bounded")
    kink, (cost, (_, slope)) = float(found.x), fit(float(found.x))
    variance = cost / max(time.size - 3, 1)
    if (np.sum((signal - signal.mean()) ** 2) - cost) < 25 * variance or slope == 0:
        raise ConvergenceError("no first motion stands out of the noise of the signal")

    def rise(k: float) -> float:
        return fit(k)[0] - cost - variance

    upper = brentq(rise, kink, time[-2]) - kink if rise(time[-2]) > 0 else np.inf
    lower = kink - brentq(rise, time[0], kink) if rise(time[0]) > 0 else np.inf
    return kink, float(max(min(upper, lower), 0.5 * (upper + lower) if np.isfinite(upper + lower) else 0.0))
