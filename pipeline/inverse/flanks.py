"""Which flank of the crack a point lies on: where measurement and simulation disagree, nothing can be compared."""

from __future__ import annotations

import numpy as np

OTHER = 0.5  # of the opening: a difference beyond it is nearer to the other flank than to its own
SEEN = 10.0  # openings of fewer standard deviations of the noise part nothing yet
ROUNDS = 20  # of reweighting towards least absolute deviations


def changed_flank(points: np.ndarray, measured: np.ndarray, std: np.ndarray, simulated: np.ndarray) -> np.ndarray:
    """Points that lie on one side of the crack in the measurement and on the other in some simulation.

    A crack that passes a point on its other side moves it by the whole opening there, hundreds of times what the
    parameters do: one such point would decide the fit. The opening at the height of a point is that of two flanks
    that part rigidly, fitted to the measured displacements across the notch line by least absolute deviations.

    Parameters
    ----------
    points : (p, 2) array, m; the notch line is x = 0
    measured : (s, p, 2) array, m, NaN where missing
    std : (s, p) array, m; noise of one measured component
    simulated : (..., s, p, 2) array, m, NaN where missing

    Returns
    -------
    (s, p) bool array
    """
    sides = np.where(points[:, 0] < 0, -1.0, 1.0)
    height = points[:, 1] / max(float(np.ptp(points[:, 1])), 1e-12)
    rigid = np.column_stack([np.ones(len(points)), height])
    parting = rigid * sides[:, None] / 2
    opening = np.abs(_robust(np.column_stack([rigid, parting]), measured[..., 0])[..., 2:] @ rigid.T)
    difference = simulated[..., 0] - measured[..., 0]
    difference = difference - _robust(rigid, difference) @ rigid.T
    other = np.abs(difference) > np.maximum(OTHER * opening, SEEN * std)
    return other.reshape(-1, *opening.shape).any(axis=0)


def _robust(basis: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients (..., k) of values (..., p) in a basis (p, k) by least absolute deviations; NaN is left out."""
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    floor = 1e-6 * max(float(np.abs(filled).max(initial=0.0)), 1e-30)
    weight = known.astype(float)
    found = np.zeros((*values.shape[:-1], basis.shape[1]))
    for _ in range(ROUNDS):
        normal = np.einsum("pi,...p,pj->...ij", basis, weight, basis)
        found = np.linalg.pinv(normal) @ np.einsum("pi,...p->...i", basis, weight * filled)[..., None]
        found = found[..., 0]
        weight = known / np.maximum(np.abs(filled - found @ basis.T), floor)
        weight /= np.maximum(weight.max(axis=-1, keepdims=True), 1e-300)
    return found
