"""Φ of interpolated data: the multinomials run through every simulated number, and are squared afterwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.inverse.newton import Smooth
from pipeline.inverse.surrogate import LagrangeSurrogate


@dataclass(frozen=True)
class SquaredDifference:
    """‖Σ w(λ) d − d̂‖² = wᵀGw with its exact derivatives; λ = (f_max, delta_max) in N and m.

    The Lagrange weights w of the nodes add up to one, so the difference of interpolated and measured data is the
    interpolated difference, and G holds the products of the nodes' differences.

    Crack paths change from node to node, so that simulated data scatter by some j about a smooth course. Φ at a node
    far from the optimum, where the residual r is large, then scatters by 2r·j, and its multinomial (Hill et al. 2017,
    eq. 6) carries that to the optimum; the multinomials of the data carry j itself.

    Parameters
    ----------
    weights : Smooth; (n,) weights of the nodes of a grid at a point, which add up to one
    gram : (n, n) array
    """

    weights: Smooth
    gram: np.ndarray

    @staticmethod
    def of(features: LagrangeSurrogate, target: np.ndarray) -> SquaredDifference:
        """From simulated data (n_f, n_d, N) and measured ones (N,)."""
        shape = features.values.shape[:2]
        count = shape[0] * shape[1]
        difference = (features.values - target).reshape(count, -1)
        weights = LagrangeSurrogate(features.f_nodes, features.d_nodes, np.eye(count).reshape(*shape, count))
        return SquaredDifference(weights, difference @ difference.T)

    @property
    def lower(self) -> np.ndarray:
        return self.weights.lower

    @property
    def upper(self) -> np.ndarray:
        return self.weights.upper

    def value(self, parameters: np.ndarray) -> np.ndarray:
        """Φ of the interpolated data."""
        weight = self.weights.value(parameters)
        return weight @ self.gram @ weight

    def gradient(self, parameters: np.ndarray) -> np.ndarray:
        """2 w'ᵀGw; (2,)."""
        return 2 * self.weights.gradient(parameters) @ self.gram @ self.weights.value(parameters)

    def hessian(self, parameters: np.ndarray) -> np.ndarray:
        """2 (w'ᵀGw' + w''ᵀGw); (2, 2)."""
        slope = self.weights.gradient(parameters)
        bend = self.weights.hessian(parameters) @ self.gram @ self.weights.value(parameters)
        return 2 * (slope @ self.gram @ slope.T + bend)

    def on_grid(self, f_max: np.ndarray, delta_max: np.ndarray) -> np.ndarray:
        """Φ on another tensor grid, for pictures; (len(f_max), len(delta_max))."""
        return np.array([[self.value(np.array([f, d])) for d in delta_max] for f in f_max])
