"""The foot of a record: seating load, toe and waiting time taken off a load–CMOD curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.units import MM, UM

STARTS, WIDTHS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3), (0.2, 0.3, 0.4, 0.5)  # windows of the rise, shares of the peak
SURE = 0.05  # relative standard error of the compliance that a window may have
ALIKE = 1.02  # a lower window is taken while its compliance, less its standard error, is below this times the least
WIDE = ((0.2, 0.5), (0.1, 0.7))  # where no such window is sure enough
ROWS, FEWEST = 5, 3  # in a window, and in a wide one
SLACK = 0.005  # of the elastic CMOD at half the peak: a row farther off the line belongs to the toe
IDLE = 0.005  # of the peak: below it the machine was waiting
MOST = 400  # rows that carry a fit: the robust line compares all pairs


@dataclass(frozen=True)
class Rise:
    """The straight part of the rise, CMOD = foot + compliance · load.

    Parameters
    ----------
    foot : float, m; CMOD where the line meets zero load
    compliance : float, m/N
    scatter : float, m; robust standard deviation of the rows about the line
    first : int; row where the straight part begins
    window : its ends, shares of the peak load
    error : float, m/N; standard error of the compliance
    """

    foot: float
    compliance: float
    scatter: float
    first: int
    window: tuple[float, float]
    error: float


def without_foot(curve: LoadCurve) -> tuple[LoadCurve, list[str]]:
    """The curve with the extrapolated rise starting at zero, what lies before it cut, and what was done.

    A straight line is fitted (median of the slopes of all pairs: Theil 1950, Sen 1968) to CMOD over load in
    the steepest part of the rise: a toe below it and softening above it are both flatter. CMOD is counted
    from where the line meets zero load, and so is the load-line displacement. Rows before the curve has
    joined the line (within 0.5 % of the elastic CMOD at half the peak, or four times the scatter), and rows
    of waiting, are cut; where the first row kept is not at the origin
    a row (0, 0) is put before it, on the line. Times are not shifted.
    """
    rise = fit_rise(curve, curve.cmod)
    if rise is None:
        return curve, ["The rise has too few rows to tell a toe from it: CMOD was left as it is."]
    start = _joined(curve, rise)
    line, std = _moved_line(curve), curve.load_std
    cut = LoadCurve(
        curve.time[start:],
        curve.cmod[start:] - rise.foot,
        curve.load[start:],
        None if line is None else line[start:],
        None if std is None else std[start:],
    )
    rooted, added = _rooted(cut, rise)
    return rooted, _told(curve, rise, start, added)


def fit_rise(curve: LoadCurve, displacement: np.ndarray) -> Rise | None:
    """The straight part of `displacement` (n,), m, over load; None where it has fewer than three rows.

    Windows begin at 5 to 30 % of the peak and are a fifth of it wide, wider where that holds fewer than five
    rows. Of those whose compliance is sure to 5 % the lowest one is taken that is as steep as the steepest,
    within 2 % and its own standard error.
    """
    fits = [_narrowest(curve, displacement, start) for start in STARTS]
    sure = [fit for fit in fits if fit is not None and 0 <= fit.error < SURE * fit.compliance]
    if sure:
        least = min(fit.compliance for fit in sure)
        return next(fit for fit in sure if fit.compliance - fit.error <= ALIKE * least)
    wide = (_fitted(curve, displacement, window, rows) for window, rows in zip(WIDE, (ROWS, FEWEST), strict=True))
    return next((fit for fit in wide if fit is not None), None)


def _narrowest(curve: LoadCurve, displacement: np.ndarray, start: float) -> Rise | None:
    """The line through the narrowest window from `start` on that holds enough rows."""
    fits = (_fitted(curve, displacement, (start, start + width), ROWS) for width in WIDTHS)
    return next((fit for fit in fits if fit is not None), None)


def _fitted(curve: LoadCurve, displacement: np.ndarray, window: tuple[float, float], fewest: int) -> Rise | None:
    """The robust line through one window, None where it has too few rows."""
    peak = int(np.argmax(curve.load))
    rows = _between(curve.load[: peak + 1], window[0] * curve.load[peak], window[1] * curve.load[peak])
    if rows.size < fewest or np.ptp(curve.load[rows]) == 0:
        return None
    used = rows[:: max(rows.size // MOST, 1)]
    slope, foot = _median_line(curve.load[used], displacement[used])
    off = displacement[rows] - foot - slope * curve.load[rows]
    scatter = 1.4826 * float(np.median(np.abs(off)))
    error = scatter / float(np.std(curve.load[rows]) * np.sqrt(rows.size))
    return Rise(float(foot), float(slope), scatter, int(rows[0]), window, error)


def _median_line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Slope and intercept of the line of median slopes (Theil 1950, Sen 1968)."""
    one, two = np.triu_indices(x.size, 1)
    apart = x[one] != x[two]
    slope = float(np.median((y[two] - y[one])[apart] / (x[two] - x[one])[apart]))
    return slope, float(np.median(y - slope * x))


def _between(load: np.ndarray, low: float, high: float) -> np.ndarray:
    """Rows from the last one below `low` to the first one above `high`."""
    below = np.flatnonzero(load < low)
    start = int(below[-1]) + 1 if below.size else 0
    above = np.flatnonzero(load[start:] > high)
    return np.arange(start, start + int(above[0]) if above.size else load.size)


def _joined(curve: LoadCurve, rise: Rise) -> int:
    """The first row to keep: on the line, and not waiting."""
    before = slice(0, rise.first)
    off = np.abs(curve.cmod[before] - rise.foot - rise.compliance * curve.load[before])
    half = abs(rise.compliance) * float(curve.load.max()) / 2
    astray = np.flatnonzero(off > max(SLACK * half, 4 * rise.scatter))
    idle = np.flatnonzero(curve.load[before] <= IDLE * float(curve.load.max()))
    return max(int(astray[-1]) + 1 if astray.size else 0, int(idle[-1]) if idle.size else 0)


def _moved_line(curve: LoadCurve) -> np.ndarray | None:
    """Load-line displacement counted from the foot of its own rise."""
    if curve.load_line is None:
        return None
    rise = fit_rise(curve, curve.load_line)
    return curve.load_line - (curve.load_line[0] if rise is None else rise.foot)


def _rooted(curve: LoadCurve, rise: Rise) -> tuple[LoadCurve, bool]:
    """The curve begun at the origin, and whether a row was put there; its time is extrapolated along the rise."""
    small = max(4 * rise.scatter, SLACK * abs(rise.compliance) * float(curve.load.max()))
    if curve.load[0] * abs(rise.compliance) <= small:
        return curve, False
    rate = _rate(curve)
    time = curve.time[0] - curve.cmod[0] / rate if rate > 0 and curve.cmod[0] > 0 else curve.time[0] - 1e-3
    rooted = LoadCurve(
        np.insert(curve.time, 0, time),
        np.insert(curve.cmod, 0, 0.0),
        np.insert(curve.load, 0, 0.0),
        None if curve.load_line is None else np.insert(curve.load_line, 0, 0.0),
        None if curve.load_std is None else np.insert(curve.load_std, 0, curve.load_std[0]),
    )
    return rooted, True


def _rate(curve: LoadCurve) -> float:
    """CMOD rate (m/s) over the first half of the rise."""
    half = max(int(np.argmax(curve.load >= 0.5 * curve.load.max())), 1)
    return float((curve.cmod[half] - curve.cmod[0]) / (curve.time[half] - curve.time[0]))


def _told(curve: LoadCurve, rise: Rise, start: int, added: bool) -> list[str]:
    """What was done, in sentences."""
    low, high = (round(100 * end) for end in rise.window)
    sentences = [
        f"Between {low} and {high} % of the peak the rise is straight within {rise.scatter / UM:.2g} µm; extended to "
        f"zero load it meets CMOD = {rise.foot / MM:.6g} mm, from where CMOD is now counted."
    ]
    if start:
        sentences.append(
            f"The first {start} rows (waiting, seating and toe, up to {curve.load[start - 1]:.4g} N) were cut; "
            "times were not shifted."
        )
    if added:
        sentences.append("A row at zero load and zero CMOD was put at the foot of the rise.")
    return sentences
