"""The Σ metric: differences counted in standard deviations of noise and discrepancy together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, eigh, solve_triangular
from scipy.special import gammaincinv, logsumexp

from pipeline.core.errors import InputError

SCALES = 12  # values of the unknown scale over which a likelihood is averaged


@dataclass(frozen=True, eq=False)
class Metric:
    """A covariance Σ = N + S of data, of which S may be known but for its scale.

    Where `tail` is finite, S stands for S tail/χ² with χ² of `tail` degrees of freedom: where N is small, differences
    follow the multivariate Student distribution.

    Parameters
    ----------
    covariance : (n, n) array Σ, positive definite
    uncertain : (n, n) array S, None: nothing
    tail : float; degrees of freedom, inf: the scale of S is known
    """

    covariance: np.ndarray
    uncertain: np.ndarray | None = None
    tail: float = np.inf

    @cached_property
    def _root(self) -> tuple[np.ndarray, np.ndarray]:
        """L⁻¹ (n, n) with L Lᵀ = Σ, and the share (n,) of S in the variance of each of its rows' components.

        Rows are joint eigenvectors of Σ and S where S is of unknown scale, so that another scale is another length of
        the components only.
        """
        try:
            if self.uncertain is None or not np.isfinite(self.tail):
                root = cholesky(self.covariance, lower=True)
                return solve_triangular(root, np.eye(len(root)), lower=True), np.zeros(len(root))
            size, shape = eigh(self.uncertain, self.covariance)
        except np.linalg.LinAlgError:
            raise InputError(
                "the covariance of the data is not positive definite: give noise above zero to all of them"
            ) from None
        return shape.T, np.clip(size, 0.0, 1.0)

    @cached_property
    def log_volume(self) -> float:
        """Logarithm of the determinant of Σ."""
        return -2 * float(np.linalg.slogdet(self._root[0])[1])

    def white(self, values: np.ndarray) -> np.ndarray:
        """L⁻¹ times values (n,) or (n, k): independent, of standard deviation one."""
        return self._root[0] @ values

    def log_likelihood(self, residual: np.ndarray, doubt: np.ndarray | None = None) -> float:
        """Logarithm of the density of a white residual (n,), but for a constant of the metric.

        −χ²/2 where the scale is known; else the mean over as many equally probable values of the variance's factor.

        Parameters
        ----------
        residual : (n,) array
        doubt : (n, k) array B; white, a further covariance B Bᵀ of these data
        """
        share = self._root[1]
        if not share.any():
            return _log_density(residual, np.ones(residual.size), doubt)
        middle = (np.arange(SCALES) + 0.5) / SCALES
        factor = self.tail / (2 * gammaincinv(self.tail / 2, middle))  # of S
        terms = [_log_density(residual, 1 + share * (f - 1), doubt) for f in factor]
        return float(logsumexp(terms) - np.log(SCALES))

    def draws(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Data (n, count) of a model that lacks nothing; where the scale of S is unknown each has one of its own."""
        whitening, share = self._root
        factor = np.ones(count) if not share.any() else self.tail / rng.chisquare(self.tail, count)
        spread = np.sqrt(1 + share[:, None] * (factor - 1))
        return self.covariance @ whitening.T @ (spread * rng.standard_normal((share.size, count)))

    def part(self, keep: np.ndarray) -> Metric:
        """The metric of some of the data, (n,) bool."""
        some = np.ix_(keep, keep)
        return Metric(self.covariance[some], None if self.uncertain is None else self.uncertain[some], self.tail)

    @property
    def std(self) -> np.ndarray:
        """Standard deviation of every datum; (n,)."""
        return np.sqrt(np.diag(self.covariance))


def doubted(white: np.ndarray, doubt: np.ndarray | None) -> np.ndarray:
    """(I + B Bᵀ)^(−1/2) times white values (n,) or (n, k): what is left where data are uncertain by B (n, j)."""
    return doubting(doubt)(white)


def doubting(doubt: np.ndarray | None) -> Callable[[np.ndarray], np.ndarray]:
    """The same as a function of the values."""
    if doubt is None or not doubt.size:
        return lambda white: white
    shape, strength, _ = np.linalg.svd(doubt, full_matrices=False)
    less = shape * (1 - 1 / np.sqrt(1 + strength**2))
    return lambda white: np.asarray(white - less @ (shape.T @ white))


def _log_density(residual: np.ndarray, variance: np.ndarray, doubt: np.ndarray | None) -> float:
    """Logarithm of a normal density of covariance diag(variance) + B Bᵀ, but for (2π)^(n/2) (Woodbury 1950)."""
    found = -0.5 * float(np.sum(residual**2 / variance + np.log(variance)))
    if doubt is None or not doubt.size:
        return found
    weighed = doubt / variance[:, None]
    inner = np.eye(doubt.shape[1]) + doubt.T @ weighed
    along = weighed.T @ residual
    return found + 0.5 * float(along @ np.linalg.solve(inner, along) - np.linalg.slogdet(inner)[1])
