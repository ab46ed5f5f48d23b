"""Whether the grid resolves the valley of Φ: the multinomial of Φ against Φ of the interpolated data."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from pipeline.inverse.uncertainty import Fit, Uncertainty

SHARE = 0.5  # of the standard deviation by which the two minima may differ
CURABLE = ("scatter", "modulus")  # what a finer grid may cure, and what moves both minima alike
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


def resolves(position: np.ndarray, data_position: np.ndarray, doubt: Uncertainty | None) -> bool:
    """Whether the two minima, (2,) each, are as one beside what noise and discrepancy leave open.

    Never where there is no interval.
    """
    if doubt is None:
        return False
    kept = [c.covariance for c in doubt.budget if c.name not in CURABLE]
    std = np.sqrt(np.diag(np.sum(kept, axis=0)))
    return bool(np.all(np.abs(position - data_position) <= np.maximum(SHARE * std, LEAST * position)))
