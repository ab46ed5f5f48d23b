"""Load–CMOD curves and the quantities read off them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError

ROUND_OFF = 1e-8  # of the last CMOD: an engine that is asked to end there may stop so much before it


@dataclass(frozen=True)
class LoadCurve:
    """A record of one fracture test.

    Parameters
    ----------
    time : (n,) array, s, increasing
    cmod : (n,) array, m; crack mouth opening displacement
    load : (n,) array, N; machine load, positive when the specimen is being opened
    load_line : (n,) array, m, optional; displacement of the machine at the load
    load_std : (n,) array, N, optional; standard deviation of `load`
    """

    time: np.ndarray
    cmod: np.ndarray
    load: np.ndarray
    load_line: np.ndarray | None = None
    load_std: np.ndarray | None = None

    def __post_init__(self) -> None:
        sizes = {np.shape(a) for a in (self.time, self.cmod, self.load)}
        if len(sizes) != 1 or len(next(iter(sizes))) != 1:
            raise InputError(f"time, cmod and load of a curve must be equally long, got {sizes}")
        if self.time.size < 3:
            raise InputError(f"a load–CMOD curve needs at least 3 rows, got {self.time.size}")

    def peak(self) -> tuple[float, float]:
        """CMOD (m) and load (N) at the peak, from a parabola through the flat top.

        The parabola is fitted to the points around the maximum whose load is above 98 % of it, at
        least three; where it does not open downwards the maximum itself is returned.
        """
        top = int(np.argmax(self.load))
        near = _around(self.load > 0.98 * self.load[top], top)
        low, high = max(min(near.start, top - 1), 0), min(max(near.stop, top + 2), self.load.size)
        x, y = self.cmod[low:high], self.load[low:high]
        spread = np.ptp(x)
        if x.size < 3 or spread == 0:
            return float(self.cmod[top]), float(self.load[top])
        a, b, c = np.polyfit((x - x[0]) / spread, y, 2)
        position = -b / (2 * a) if a < 0 else -1.0
        if not 0 <= position <= 1:
            return float(self.cmod[top]), float(self.load[top])
        return float(x[0] + spread * position), float(c - b * b / (4 * a))

    def load_at(self, cmod: np.ndarray) -> np.ndarray:
        """Load (N) when the CMOD (m) first reaches each value; NaN outside the record."""
        return _at_first_passage(self.cmod, self.load, cmod)

    def time_at(self, cmod: np.ndarray) -> np.ndarray:
        """Time (s) when the CMOD (m) first reaches each value; NaN outside the record."""
        return _at_first_passage(self.cmod, self.time, cmod)

    def cmod_at(self, time: np.ndarray) -> np.ndarray:
        """CMOD (m) at each time (s); NaN outside the record."""
        return np.interp(time, self.time, self.cmod, left=np.nan, right=np.nan)

    def cmod_area(self) -> float:
        """Area under load–CMOD (J); larger than the work by up to 4W/S for a hinged beam."""
        return float(np.trapezoid(self.load, self.cmod))

    def work(self) -> float:
        """Area under load–load-line displacement (J); NaN where no load line was recorded."""
        return float("nan") if self.load_line is None else float(np.trapezoid(self.load, self.load_line))

    def until(self, cmod: float) -> LoadCurve:
        """The curve up to the first row whose CMOD (m) exceeds `cmod`."""
        beyond = np.flatnonzero(self.cmod > cmod)
        stop = slice(None, max(int(beyond[0]) + 1, 3)) if beyond.size else slice(None)
        cut = {k: v[stop] for k, v in vars(self).items() if v is not None}
        return LoadCurve(**cut)


def _around(mask: np.ndarray, index: int) -> slice:
    """The run of True in `mask` that holds `index`."""
    outside = np.flatnonzero(~mask)
    low, high = outside[outside < index], outside[outside > index]
    return slice(int(low[-1]) + 1 if low.size else 0, int(high[0]) if high.size else mask.size)


def _at_first_passage(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Interpolate y where the running maximum of x first reaches each value of `at`; its end is known to round-off."""
    reached = np.maximum.accumulate(x)
    rising = np.concatenate([[True], np.diff(reached) > 0])
    end = reached[-1]
    at = np.where((at > end) & (at <= end + ROUND_OFF * abs(end)), end, at)
    return np.interp(at, reached[rising], y[rising], left=np.nan, right=np.nan)
