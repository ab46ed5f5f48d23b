"""Displacement fields at points; measurement and simulation give the same type."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.errors import InputError


@dataclass(frozen=True)
class DisplacementField:
    """Displacements of material points, frame by frame (Lagrangian: reference point → displacement).

    Parameters
    ----------
    points : (n, 2) array, m; reference positions in specimen coordinates
    displacement : (frames, n, 2) array, m; from the unloaded state
    valid : (frames, n) bool array
    std : (frames, n) array, m; standard deviation of one displacement component
    abscissa : (frames,) array; what the frames are counted by: time in s for a measured series, CMOD
        in m for a field brought to CMOD stations
    """

    points: np.ndarray
    displacement: np.ndarray
    valid: np.ndarray
    std: np.ndarray
    abscissa: np.ndarray

    def __post_init__(self) -> None:
        frames, n = self.valid.shape
        expected = {"points": (n, 2), "displacement": (frames, n, 2), "std": (frames, n), "abscissa": (frames,)}
        for name, shape in expected.items():
            if np.shape(getattr(self, name)) != shape:
                raise InputError(
                    f"{name} of a displacement field has shape {np.shape(getattr(self, name))}, expected {shape}"
                )

    def at(self, abscissa: np.ndarray) -> DisplacementField:
        """The field at other values of the abscissa, linearly between frames; invalid outside them."""
        x = np.asarray(abscissa, float)
        upper = np.clip(np.searchsorted(self.abscissa, x), 1, self.abscissa.size - 1)
        lower = upper - 1
        share = (x - self.abscissa[lower]) / (self.abscissa[upper] - self.abscissa[lower])
        inside = (share >= -1e-9) & (share <= 1 + 1e-9)
        share = np.clip(share, 0, 1)
        mix = share[:, None, None]
        return replace(
            self,
            displacement=(1 - mix) * self.displacement[lower] + mix * self.displacement[upper],
            valid=_needed(self.valid, lower, upper, share) & inside[:, None],
            std=np.hypot((1 - share)[:, None] * self.std[lower], share[:, None] * self.std[upper]),
            abscissa=x,
        )


def _needed(valid: np.ndarray, lower: np.ndarray, upper: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Both neighbours must be valid unless the value lies on one of them."""
    return (valid[lower] | (share == 1)[:, None]) & (valid[upper] | (share == 0)[:, None])


def rigid_residual(points: np.ndarray, residual: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Take the least-squares translation and small rotation out of each frame of `residual`.

    Parameters
    ----------
    points : (n, 2) array, m
    residual : (frames, n, 2) array, m
    valid : (frames, n) bool array; only these points carry the fit

    Returns
    -------
    (frames, n, 2) array, m
    """
    left = np.array(residual, float)
    for frame, use in zip(left, valid, strict=True):
        if use.sum() >= 2:
            frame -= rigid_motion(points, frame, use)
    return left


def rigid_motion(points: np.ndarray, displacement: np.ndarray, use: np.ndarray) -> np.ndarray:
    """The least-squares translation and small rotation of the used points, at all points; (..., n, 2), m.

    Parameters
    ----------
    points : (n, 2) array, m
    displacement : (..., n, 2) array, m
    use : (n,) bool array
    """
    arm = points - points[use].mean(axis=0)
    turned = np.column_stack([-arm[:, 1], arm[:, 0]])
    known = displacement[..., use, :]
    shift = known.mean(axis=-2, keepdims=True)
    angle = np.sum(turned[use] * (known - shift), axis=(-2, -1), keepdims=True) / np.sum(turned[use] ** 2)
    return shift + angle * turned
