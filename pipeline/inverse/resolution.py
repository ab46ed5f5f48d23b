"""Whether the grid resolves the valley of Φ: the multinomial of Φ against Φ of the interpolated data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from pipeline.inverse.discrepancy import Discrepancy
from pipeline.inverse.newton import Minimum
from pipeline.inverse.uncertainty import Fit, uncertainty

SHARE = 0.3  # of a standard deviation by which the two minima may differ: a tenth more variance
LEAST = 1e-3  # of the parameters themselves; finer than this nothing is asked for


def data_minimum(fit: Fit) -> np.ndarray:
    """Where the squared difference of measured and *interpolated* data is smallest near the optimum; (2,), N and m.

    Data bend far less over the grid than their squares do, so that this minimum is nearer to the truth where the two
    differ; it needs all data where the multinomial of Φ (Hill et al. 2017, eq. 6) needs one number a node.
    """
    low, size = fit.features.lower, fit.features.upper - fit.features.lower
    start = np.clip((fit.minimum.position - low) / size, 0.0, 1.0)
    found = least_squares(
        lambda x: fit.features.value(low + size * x) - fit.comparison.target,
        start,
        jac=lambda x: fit.features.gradient(low + size * x).T * size,
        bounds=(0.0, 1.0),
    )
    return low + size * found.x


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
