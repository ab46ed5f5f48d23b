"""How two honest models of one specimen differ: long waves along CMOD and along a crack flank, not white noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.inverse.objective import Comparison

KEPT = 1e-3  # share of a correlation's trace that may be left out as too short-waved to matter


@dataclass(frozen=True)
class Discrepancy:
    """A Gaussian process for what remains between simulation and test at the true parameters.

    Correlation exp(−|Δcmod|/length) along the test; between points exp(−d²/(2 spread²)) on one flank of the
    notch line, none across it; the two components of displacement are independent.

    Parameters
    ----------
    length : float, m of CMOD
    spread : float, m
    field : float, m, standard deviation of one displacement component; None: from the fit's own residual
    load : float, N, standard deviation; None: from the fit's own residual
    """

    length: float = 0.4e-3
    spread: float = 10e-3
    field: float | None = None
    load: float | None = None

    def __post_init__(self) -> None:
        if not (self.length > 0 and self.spread > 0):
            raise InputError(f"correlation lengths {self.length:g} m and {self.spread:g} m must be positive")
        if any(a is not None and not a >= 0 for a in (self.field, self.load)):
            raise InputError(f"discrepancies {self.field} m and {self.load} N must not be negative")


@dataclass(frozen=True)
class Wave:
    """A part of the discrepancy: independent unit sources and how strongly they are excited.

    Parameters
    ----------
    kind : "field" or "load"
    columns : (N, k) array; effect of each source of 1 m or 1 N on the features
    amplitude : float, m or N
    freedom : float; effective degrees of freedom behind the amplitude, inf where it was given
    """

    kind: str
    columns: np.ndarray
    amplitude: float
    freedom: float


def unit_waves(comparison: Comparison, discrepancy: Discrepancy) -> dict[str, np.ndarray]:
    """Columns (N, k) whose outer product is the covariance of a discrepancy of 1 m (field) or 1 N (load)."""
    along = _root(
        np.exp(-np.abs(np.subtract.outer(comparison.measured.cmod, comparison.measured.cmod)) / discrepancy.length)
    )
    stations = len(along)
    found = {}
    if comparison.use_field.any():
        across = _root(_on_flank(comparison, discrepancy.spread))
        scalar = np.einsum("sa,pb->absp", along, across).reshape(-1, stations, len(across))
        fields = np.concatenate([np.stack([scalar, 0 * scalar], -1), np.stack([0 * scalar, scalar], -1)])
        found["field"] = comparison.features(fields, np.zeros((len(fields), stations))).T
    if comparison.use_load.any():
        nothing = np.zeros((along.shape[1], *comparison.use_field.shape, 2))
        found["load"] = comparison.features(nothing, along.T).T
    return found


def waves(
    comparison: Comparison, discrepancy: Discrepancy, residual: np.ndarray, slopes: np.ndarray
) -> tuple[Wave, ...]:
    """The discrepancy with its amplitudes, given or estimated from the residual at the optimum.

    Only what the fit of two parameters (and of the rigid motion) has left can be seen in the residual. Its
    independent waves i have variance noise_i + amplitude²·s_i². Under a flat prior the posterior of amplitude²
    is matched, in mean and variance, by the scaled inverse χ² that stands behind Student's t: its scale and
    degrees of freedom are returned. So the sum never falls below noise, and an amplitude hidden in the noise
    does not count as none.

    Parameters
    ----------
    comparison : Comparison
    discrepancy : Discrepancy
    residual : (N,) array; measured − fitted features
    slopes : (N, 2) array; derivatives of the features
    """
    blocks = {"field": slice(0, comparison.field_size), "load": slice(comparison.field_size, None)}
    given = {"field": discrepancy.field, "load": discrepancy.load}
    basis = np.linalg.qr(slopes)[0]
    found = []
    for kind, columns in unit_waves(comparison, discrepancy).items():
        amplitude, freedom, block = given[kind], np.inf, blocks[kind]
        if amplitude is None:
            left = (columns - basis @ (basis.T @ columns))[block]
            amplitude, freedom = _estimated(left, residual[block], comparison.noise[block])
        found.append(Wave(kind, columns, amplitude, freedom))
    return tuple(found)


def _estimated(left: np.ndarray, residual: np.ndarray, noise: np.ndarray) -> tuple[float, float]:
    """Scale of the amplitude and the degrees of freedom behind it.

    Parameters
    ----------
    left : (N, k) array; what the fit leaves of unit waves
    residual : (N,) array
    noise : (N,) array; variances
    """
    shapes, sizes, _ = np.linalg.svd(left, full_matrices=False)
    seen = sizes > 1e-6 * sizes[0]
    shapes, strength = shapes[:, seen], sizes[seen] ** 2
    heard, hiss = (shapes.T @ residual) ** 2, (shapes**2).T @ noise
    scale = np.sqrt(heard.sum() / strength.sum())
    if scale == 0:
        return 0.0, np.inf
    square = (scale * np.linspace(0, 8, 801)) ** 2
    variance = np.maximum(hiss + square[:, None] * strength, 1e-12 * square[-1] * strength[0])  # data without noise
    likelihood = -0.5 * np.sum(np.log(variance) + heard / variance, axis=1)
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    mean = float(weight @ square)
    freedom = 4 + 2 * mean**2 / float(weight @ (square - mean) ** 2)
    return float(np.sqrt(mean * (freedom - 2) / freedom)), freedom


def _on_flank(comparison: Comparison, spread: float) -> np.ndarray:
    assert comparison.measured.field is not None
    points = comparison.measured.field.points
    square = np.sum((points[:, None] - points[None]) ** 2, axis=-1)
    right = points[:, 0] >= 0
    return np.exp(-square / (2 * spread**2)) * (right[:, None] == right[None])


def _root(correlation: np.ndarray) -> np.ndarray:
    """Columns whose outer product is the correlation, the weakest left out; (n, k)."""
    strength, shape = np.linalg.eigh(correlation)
    order = np.argsort(strength)[::-1]
    strength, shape = np.clip(strength[order], 0, None), shape[:, order]
    kept = int(np.searchsorted(np.cumsum(strength), (1 - KEPT) * strength.sum())) + 1
    return shape[:, :kept] * np.sqrt(strength[:kept])
