"""The Σ metric: differences counted in standard deviations of noise and discrepancy together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from pipeline.core.errors import InputError


@dataclass(frozen=True, eq=False)
class Metric:
    """A covariance Σ = L Lᵀ.

    Parameters
    ----------
    covariance : (n, n) array, positive definite
    """

    covariance: np.ndarray

    @cached_property
    def _inverse(self) -> np.ndarray:
        """L⁻¹ (n, n)."""
        try:
            root = cholesky(self.covariance, lower=True)
        except np.linalg.LinAlgError:
            raise InputError(
                "the covariance of the data is not positive definite: give noise above zero to all of them"
            ) from None
        return solve_triangular(root, np.eye(len(root)), lower=True)

    def white(self, values: np.ndarray) -> np.ndarray:
        """L⁻¹ times values (n,) or (n, k): independent, of standard deviation one."""
        return self._inverse @ values

    def part(self, keep: np.ndarray) -> Metric:
        """The metric of some of the data, (n,) bool."""
        return Metric(self.covariance[np.ix_(keep, keep)])

    @property
    def std(self) -> np.ndarray:
        """Standard deviation of every datum; (n,)."""
        return np.sqrt(np.diag(self.covariance))
