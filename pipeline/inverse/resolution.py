"""Whether the grid resolves the valley of Φ: the multinomial of Φ against Φ of the interpolated data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.inverse.discrepancy import Discrepancy
from pipeline.inverse.newton import Minimum, minimise
from pipeline.inverse.squares import SquaredDifference
from pipeline.inverse.uncertainty import Fit, uncertainty

SHARE = 0.3  # of a standard deviation by which the two minima may differ: a tenth more variance
LEAST = 1e-3  # of the parameters themselves; finer than this nothing is asked for


def data_minimum(fit: Fit) -> np.ndarray:
    """Where Φ of the interpolated data is smallest, from the optimum on; (2,), N and m."""
    squares = SquaredDifference.of(fit.features, fit.comparison.target)
    return minimise(squares, fit.minimum.position[None])[0].position


def resolves(fit: Fit, data_position: np.ndarray, discrepancy: Discrepancy) -> bool:
    """Whether the two minima are as one beside what noise and discrepancy leave open.

    Both are judged at the minimum of the interpolated data, where the residual holds no error of the multinomial. What
    moves both minima alike, the modulus, does not count.

    Parameters
    ----------
    fit : Fit
    data_position : (2,) array, N and m; from `data_minimum`
    discrepancy : Discrepancy
    """
    slopes = fit.features.gradient(data_position).T
    there = Minimum(data_position, 0.0, 2 * slopes.T @ slopes, True, True, 0)  # the Hessian without its second part
    if not there.convex:
        return True  # data that cannot tell the two apart: no grid helps
    doubt = uncertainty(replace(fit, minimum=there), discrepancy, 0.0)
    parts = [part.covariance for part in doubt.budget if part.name != "scatter"]
    std = np.sqrt(np.diag(np.sum(parts, axis=0)))
    apart = np.abs(fit.minimum.position - data_position)
    return bool(np.all(apart <= np.maximum(SHARE * std, LEAST * data_position)))
