"""The opening across the notch, read off a displacement field like a clip gauge."""

from __future__ import annotations

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField


def opening(
    field: DisplacementField, left: np.ndarray, right: np.ndarray, reach: float, shared: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of one gauge point against the other, along the line between them.

    Each foot moves with the plane fitted to the valid points within reach on its own side.

    Parameters
    ----------
    field : DisplacementField
    left, right : (2,) arrays, m; feet of the gauge
    reach : float, m
    shared : float, m; edge of a subset: the errors of points nearer to each other go together as their subsets overlap

    Returns
    -------
    opening : (frames,) array, m; positive when the feet part; NaN where a foot has no valid points
    std : (frames,) array, m

    Raises
    ------
    InputError
        if fewer than three points lie within reach of a foot
    """
    left, right = np.asarray(left, float), np.asarray(right, float)
    along = (right - left) / np.linalg.norm(right - left)
    middle = (left + right) / 2
    total, variance = np.zeros(len(field.abscissa)), np.zeros(len(field.abscissa))
    for foot, sign in ((left, -1.0), (right, 1.0)):
        own = ((field.points - middle) @ along) * sign > 0
        near = own & (np.linalg.norm(field.points - foot, axis=1) <= reach)
        if near.sum() < 3:
            raise InputError(
                f"only {int(near.sum())} points lie within {reach * 1e3:g} mm of the gauge foot at "
                f"({foot[0] * 1e3:g}, {foot[1] * 1e3:g}) mm: enlarge the reach or move the foot into the picture"
            )
        value, spread = _foot(field, near, foot, along, shared)
        total, variance = total + sign * value, variance + spread
    return total, np.sqrt(variance)


def rigid_opening(
    field: DisplacementField, left: np.ndarray, right: np.ndarray, arms: tuple[np.ndarray, np.ndarray], shared: float
) -> tuple[np.ndarray, np.ndarray]:
    """The opening at feet that no picture shows, each carried by its arm as by a rigid body.

    Parameters
    ----------
    field : DisplacementField
    left, right : (2,) arrays, m; feet of the gauge
    arms : two (n,) bool arrays; the points of the left and of the right arm
    shared : float, m; as of `opening`

    Returns
    -------
    opening, std : (frames,) arrays, m; NaN where an arm has fewer than three valid points
    """
    along = (right - left) / np.linalg.norm(right - left)
    total, variance = np.zeros(len(field.abscissa)), np.zeros(len(field.abscissa))
    for foot, arm, sign in ((left, arms[0], -1.0), (right, arms[1], 1.0)):
        for frame, usable in enumerate(field.valid):
            use = arm & usable
            if use.sum() < 3:
                total[frame] = np.nan
                continue
            weight = _rigid_weight(field.points[use], foot, along)
            total[frame] += sign * np.sum(weight * field.displacement[frame][use])
            error = weight * field.std[frame][use][:, None]
            overlap = _overlap(field.points[use], shared)
            variance[frame] += sum(float(e @ overlap @ e) for e in error.T)
    return total, np.sqrt(variance)


def _rigid_weight(points: np.ndarray, foot: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Weights (n, 2) whose sum with displacements is the motion of a foot that goes with them as one rigid body."""
    arm = points - points.mean(axis=0)
    reach = foot - points.mean(axis=0)
    turned, lever = np.column_stack([-arm[:, 1], arm[:, 0]]), np.array([-reach[1], reach[0]])
    return along / len(points) + turned * float(lever @ along) / np.sum(arm**2)


def _foot(
    field: DisplacementField, near: np.ndarray, foot: np.ndarray, along: np.ndarray, shared: float
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement along the gauge (frames,) and its variance, from a plane through the valid points of each frame."""
    value, variance = np.full(len(field.abscissa), np.nan), np.full(len(field.abscissa), np.nan)
    for frame, usable in enumerate(field.valid):
        use = near & usable
        arm = field.points[use] - foot
        basis = np.column_stack([np.ones(len(arm)), arm / max(np.abs(arm).max(initial=0), 1e-300)])
        if use.sum() < 3 or np.linalg.matrix_rank(basis) < 3:
            continue
        weight = np.linalg.pinv(basis)[0]
        value[frame] = weight @ (field.displacement[frame][use] @ along)
        error = weight * field.std[frame][use]
        variance[frame] = error @ _overlap(field.points[use], shared) @ error
    return value, variance


def _overlap(points: np.ndarray, edge: float) -> np.ndarray:
    """Share (n, n) that square subsets around points (n, 2) have in common: the correlation of their errors."""
    if edge <= 0:
        return np.eye(len(points))
    apart = np.abs(points[:, None] - points) / edge
    return np.prod(np.clip(1 - apart, 0, None), axis=2)
