"""The fit with more than two parameters: what else the data can tell, and what they cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from pipeline.core.errors import InputError
from pipeline.inverse.discrepancy import waves
from pipeline.inverse.estimate import Settings
from pipeline.inverse.newton import Minimum, minimise
from pipeline.inverse.objective import compare
from pipeline.inverse.observations import Measured, Simulated
from pipeline.inverse.placements import Placements
from pipeline.inverse.sparse import SparseGrid
from pipeline.inverse.squares import SquaredDifference

STARTS = 5  # nodes with the smallest difference, from which Newton's method runs


@dataclass(frozen=True)
class Widened:
    """Estimates of d parameters from one sparse grid.

    Parameters
    ----------
    names : (d,) tuple of str
    grid : SparseGrid
    minimum : Minimum of the squared difference of interpolated data
    covariance : (d, d) array: noise, discrepancy and placement; NaN where the curvature is not positive definite
    freedom : float; effective degrees of freedom of the discrepancy
    confidence : float
    """

    names: tuple[str, ...]
    grid: SparseGrid
    minimum: Minimum
    covariance: np.ndarray
    freedom: float
    confidence: float

    @property
    def intervals(self) -> np.ndarray:
        """(d, 2) array; NaN where there are none."""
        half = t.ppf((1 + self.confidence) / 2, self.freedom) * np.sqrt(np.diag(self.covariance))
        return self.minimum.position[:, None] + half[:, None] * np.array([-1.0, 1.0])

    @property
    def correlation(self) -> np.ndarray:
        """(d, d) array."""
        size = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(size, size)

    @property
    def determined(self) -> np.ndarray:
        """Which parameters the data determine: inside the grid, with an interval narrower than it; (d,) bool."""
        low, high = self.intervals.T
        place = (self.minimum.position - self.grid.lower) / (self.grid.upper - self.grid.lower)
        return (high - low < 2 * self.grid.half) & (place > 1e-6) & (place < 1 - 1e-6)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must know before the numbers."""
        found = [] if self.minimum.converged else [f"more parameters: {self.minimum.status}"]
        if not np.isfinite(self.covariance).all():
            return (*found, "more parameters: the data cannot tell them apart (no positive definite curvature)")
        open_ones = [name for name, good in zip(self.names, self.determined, strict=True) if not good]
        if open_ones:
            found.append(f"the data do not determine {', '.join(open_ones)}: the grid's width decides, not the test")
        return tuple(found)


def widen(
    names: tuple[str, ...],
    grid: SparseGrid,
    simulated: Simulated,
    measured: Measured,
    settings: Settings,
    placements: Placements | None = None,
) -> Widened:
    """Estimate all parameters of a sparse grid of simulations together.

    Parameters
    ----------
    names : (d,) names of the parameters
    grid : SparseGrid of n nodes
    simulated : Simulated with the nodes along the first axis and one entry along the second: (n, 1, ...)
    measured : Measured
    settings : Settings
    placements : Placements near the optimum, or None

    Raises
    ------
    InputError
        where the simulations are not those of the grid, or have too little in common with the measurement
    """
    if placements is not None:
        placements = placements.comparable(measured)
        simulated = placements.averaged(simulated)
    comparison = compare(measured, simulated, settings.objective, settings.rigid)
    features = comparison.features(simulated.displacement, simulated.load)[:, 0]
    if len(features) != len(grid.nodes):
        raise InputError(f"{len(features)} simulations are not the {len(grid.nodes)} nodes of the grid")
    difference = features - comparison.target
    valley = SquaredDifference(grid, difference @ difference.T)
    best = minimise(valley, grid.nodes[np.argsort(np.diag(valley.gram))[:STARTS]])[0]
    slopes = grid.gradient(best.position).dot(features).T
    covariance, freedom = np.full((len(names), len(names)), np.nan), 1.0
    if best.convex:
        response = 2 * np.linalg.solve(best.hessian, slopes.T)
        residual = comparison.target - grid.value(best.position) @ features
        covariance = (response * comparison.noise) @ response.T
        found = waves(comparison, settings.discrepancy, residual, slopes)
        freedom = min((wave.freedom for wave in found), default=np.inf)
        moves = [wave.amplitude * (response @ wave.columns) for wave in found]
        covariance = covariance + sum(moved @ moved.T for moved in moves)
        if placements is not None:
            placed = placements.deviations(comparison) @ response.T
            covariance = covariance + (1 + 1 / len(placed)) * (placed.T @ placed) / (len(placed) - 1)
            freedom = min(freedom, len(placed) - 1)
    return Widened(names, grid, best, covariance, freedom, settings.confidence)
