"""Φ of interpolated data: the multinomials run through every simulated number, and are squared afterwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.inverse.surrogate import LagrangeSurrogate


@dataclass(frozen=True)
class SquaredDifference:
    """‖d(λ) − d̂‖² with its exact derivatives; λ = (f_max, delta_max) in N and m.

    Crack paths change from node to node, so that simulated data scatter by some j about a smooth course. Φ at a node
    far from the optimum, where the residual r is large, then scatters by 2r·j, and its multinomial (Hill et al. 2017,
    eq. 6) carries that to the optimum; the multinomials of the data carry j itself.

    Parameters
    ----------
    features : LagrangeSurrogate of the simulated data (n_f, n_d, N)
    target : (N,) array; the measured data
    """

    features: LagrangeSurrogate
    target: np.ndarray

    @property
    def lower(self) -> np.ndarray:
        return self.features.lower

    @property
    def upper(self) -> np.ndarray:
        return self.features.upper

    def value(self, parameters: np.ndarray) -> np.ndarray:
        """Φ of the interpolated data."""
        return np.sum((self.features.value(parameters) - self.target) ** 2)

    def gradient(self, parameters: np.ndarray) -> np.ndarray:
        """2 Jᵀr; (2,)."""
        residual = self.features.value(parameters) - self.target
        return 2 * self.features.gradient(parameters) @ residual

    def hessian(self, parameters: np.ndarray) -> np.ndarray:
        """2 (JᵀJ + Σ r ∂²d); (2, 2)."""
        residual = self.features.value(parameters) - self.target
        slopes = self.features.gradient(parameters)
        return 2 * (slopes @ slopes.T + self.features.hessian(parameters) @ residual)
