"""Values at a point from the particles around it, by a weighted least-squares plane."""

from __future__ import annotations

import numpy as np

from pipeline.core.errors import InputError


def plane_weights(position: np.ndarray, point: np.ndarray, reach: float) -> np.ndarray:
    """Weights w (k,) with which Σ wᵢ fᵢ is the value at `point` of the plane fitted to f.

    The fit is weighted by (1 − (d/reach)²)² with d the distance to the point, so that weights change
    smoothly as particles enter and leave; an affine field is reproduced exactly, also outside the hull.

    Parameters
    ----------
    position : (k, 2) array, m
    point : (2,) array, m
    reach : float, m; particles farther than this do not count

    Raises
    ------
    InputError
        if the particles in reach do not span a plane
    """
    arm = (np.asarray(position, float) - point) / reach
    kernel = np.clip(1 - np.sum(arm**2, axis=1), 0, None) ** 2
    basis = np.column_stack([np.ones(len(arm)), arm])
    moment = basis.T @ (kernel[:, None] * basis)
    if len(arm) < 3 or np.linalg.cond(moment) > 1e10:
        raise InputError(
            f"no plane can be fitted around ({point[0] * 1e3:g}, {point[1] * 1e3:g}) mm from {int((kernel > 0).sum())} "
            "particles in reach: move the point into the material or refine the particles"
        )
    return kernel * (basis @ np.linalg.solve(moment, [1.0, 0.0, 0.0]))
