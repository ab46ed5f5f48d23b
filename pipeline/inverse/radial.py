"""A second surrogate: radial basis functions through the same simulations, to check the Lagrange multinomials by."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.optimize import minimize

from pipeline.inverse.surrogate import LagrangeSurrogate

KERNEL, DEGREE = "quintic", 2  # r⁵ with polynomials of degree two: smooth enough for a minimum
STARTS = 3


def radial_minimum(features: LagrangeSurrogate, target: np.ndarray) -> np.ndarray:
    """Where the squared difference is least when radial basis functions interpolate the data.

    Multinomials of degree four may swing between nodes; radial functions swing elsewhere. Where both minima agree,
    neither swing decides.

    Parameters
    ----------
    features : LagrangeSurrogate of simulated data (N,), whose nodes and values are used
    target : (N,) array; measured data

    Returns
    -------
    (2,) array; f_max in N, delta_max in m
    """
    f, d = np.meshgrid(features.f_nodes, features.d_nodes, indexing="ij")
    low, size = features.lower, features.upper - features.lower
    nodes = (np.column_stack([f.ravel(), d.ravel()]) - low) / size
    difference = features.values.reshape(len(nodes), -1) - target
    weights = RBFInterpolator(nodes, np.eye(len(nodes)), kernel=KERNEL, degree=DEGREE)
    gram = difference @ difference.T
    scale = float(np.trace(gram)) / len(nodes)

    def objective(at: np.ndarray) -> float:
        weight = weights(at[None])[0]
        return float(weight @ gram @ weight) / scale

    starts = nodes[np.argsort(np.diag(gram))[:STARTS]]
    runs = [minimize(objective, start, method="L-BFGS-B", bounds=[(0, 1), (0, 1)]) for start in starts]
    return low + size * min(runs, key=lambda run: run.fun).x
