"""Scatter of the load, estimated from the record itself."""

from __future__ import annotations

import numpy as np

from pipeline.core.curve import LoadCurve

RESOLUTION = 1e-4  # of the peak: no load cell is better


def estimate_load_noise(curve: LoadCurve) -> float:
    """Standard deviation (N) of the load readings, robust against the curve's shape and single jumps.

    White noise of standard deviation σ gives second differences of standard deviation √6 σ; theirs is
    taken as 1.4826 × the median absolute value, which the few rows around the peak do not move. A record
    written in coarse steps q scatters at least by q/√12 (uniform rounding), and never by less than 1e-4 of
    the peak. Where the record is so sparse that its own bend exceeds the noise, the estimate is too large.

    Parameters
    ----------
    curve : LoadCurve

    Returns
    -------
    float, N
    """
    bend = np.diff(curve.load, 2)
    scatter = 1.4826 * float(np.median(np.abs(bend))) / np.sqrt(6)
    steps = np.diff(np.unique(curve.load))
    rounding = float(steps.min()) / np.sqrt(12) if steps.size else 0.0
    return max(scatter, rounding, RESOLUTION * float(np.abs(curve.load).max()))
