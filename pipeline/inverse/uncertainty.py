"""How sure the estimate is: cov = H⁻¹(4JᵀΣJ)H⁻¹, term by term, and what the interval contains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm, t

from pipeline.core.errors import InputError
from pipeline.inverse.discrepancy import Discrepancy, Wave, waves
from pipeline.inverse.newton import Minimum
from pipeline.inverse.objective import Comparison, Objective
from pipeline.inverse.surrogate import LagrangeSurrogate, node_covariance, node_scatter

Interval = tuple[float, float]


@dataclass(frozen=True)
class Contribution:
    """One source of error.

    Parameters
    ----------
    name : str
    sentence : str; what it is and how large
    covariance : (2, 2) array of (f_max, delta_max), N and m
    freedom : float; degrees of freedom behind its size, inf where it is known
    """

    name: str
    sentence: str
    covariance: np.ndarray
    freedom: float = np.inf


@dataclass(frozen=True)
class Uncertainty:
    """Intervals of the estimate, and where they come from.

    The energy of a bond f_max·delta_max/2 stands for the fracture energy, G_f = f_max·delta_max/(2 r t):
    it is better determined than either factor where these are negatively correlated.

    Parameters
    ----------
    position : (2,) array, f_max in N and delta_max in m
    confidence : float
    budget : tuple of Contribution
    lacks : tuple of str; what the intervals do not contain
    """

    position: np.ndarray
    confidence: float
    budget: tuple[Contribution, ...]
    lacks: tuple[str, ...]

    @property
    def covariance(self) -> np.ndarray:
        """Of (f_max, delta_max); (2, 2), N and m."""
        return np.sum([c.covariance for c in self.budget], axis=0)

    @property
    def correlation(self) -> float:
        """Of f_max and delta_max."""
        c = self.covariance
        return float(c[0, 1] / np.sqrt(c[0, 0] * c[1, 1]))

    @property
    def contains(self) -> tuple[str, ...]:
        """What the intervals contain, in sentences."""
        return tuple(c.sentence for c in self.budget)

    @property
    def f_max(self) -> Interval:
        """Interval of f_max (N)."""
        return self._interval(np.array([1.0, 0.0]), self.position[0])

    @property
    def delta_max(self) -> Interval:
        """Interval of delta_max (m)."""
        return self._interval(np.array([0.0, 1.0]), self.position[1])

    @property
    def bond_energy(self) -> Interval:
        """Interval of f_max·delta_max/2 (J)."""
        return self._interval(self.position[::-1] / 2, self.position.prod() / 2)

    @property
    def noise_only(self) -> dict[str, Interval]:
        """Intervals from the white measuring noise alone: a *lower bound* of the uncertainty, never the answer."""
        noise = self.budget[0].covariance
        half = norm.ppf((1 + self.confidence) / 2) * np.sqrt(np.diag(noise))
        low, high = self.position - half, self.position + half
        return {"f_max": (float(low[0]), float(high[0])), "delta_max": (float(low[1]), float(high[1]))}

    def std(self, direction: np.ndarray) -> float:
        """Standard deviation of direction·(f_max, delta_max)."""
        return float(np.sqrt(direction @ self.covariance @ direction))

    def _interval(self, direction: np.ndarray, centre: float) -> Interval:
        half = t.ppf((1 + self.confidence) / 2, self._freedom(direction)) * self.std(direction)
        return float(centre - half), float(centre + half)

    def _freedom(self, direction: np.ndarray) -> float:
        """Welch–Satterthwaite degrees of freedom of the sum of the contributions; at least one."""
        parts = [float(direction @ c.covariance @ direction) for c in self.budget]
        doubt = sum(part**2 / c.freedom for part, c in zip(parts, self.budget, strict=True))
        return max(1.0, sum(parts) ** 2 / doubt) if doubt > 0 else np.inf


@dataclass(frozen=True)
class Fit:
    """An optimum with all that its uncertainty needs.

    Parameters
    ----------
    comparison : Comparison
    surrogate : LagrangeSurrogate of Φ
    features : LagrangeSurrogate of the simulations' features
    load : LagrangeSurrogate of the simulated loads (n_f, n_d, s), or None
    minimum : Minimum of the surrogate, or of Φ of the interpolated features
    by_data : bool; which of the two
    placed : (k, N) array; features of k placements of the lattice minus their mean, or None: one was used
    """

    comparison: Comparison
    surrogate: LagrangeSurrogate
    features: LagrangeSurrogate
    load: LagrangeSurrogate | None
    minimum: Minimum
    by_data: bool = False
    placed: np.ndarray | None = None

    @property
    def slopes(self) -> np.ndarray:
        """J: derivatives of the features after f_max and delta_max, from the stored grid fields; (N, 2)."""
        return self.features.gradient(self.minimum.position).T

    @property
    def residual(self) -> np.ndarray:
        """Measured − fitted features; (N,)."""
        return self.comparison.target - self.features.value(self.minimum.position)

    @property
    def response(self) -> np.ndarray:
        """Change of the optimum per change of the data, 2H⁻¹Jᵀ; (2, N)."""
        return 2 * np.linalg.solve(self.minimum.hessian, self.slopes.T)


def uncertainty(fit: Fit, discrepancy: Discrepancy, modulus_std: float, confidence: float = 0.95) -> Uncertainty:
    """Intervals of f_max, delta_max and the bond's energy.

    Σ is the sum of measuring noise, engine discrepancy, the modulus and the scatter of the simulations
    themselves; each term goes through 2H⁻¹Jᵀ by its own independent sources (so stations are never
    taken as independent).

    Parameters
    ----------
    fit : Fit, its Hessian positive definite
    discrepancy : Discrepancy
    modulus_std : float, relative; standard deviation of the modulus used in the simulations
    confidence : float

    Raises
    ------
    InputError
        if the Hessian is not positive definite, or modulus_std is negative
    """
    if not fit.minimum.convex:
        raise InputError("no interval exists where the Hessian is not positive definite: move or widen the grid")
    if not modulus_std >= 0:
        raise InputError(f"modulus_std = {modulus_std} must not be negative")
    found = waves(fit.comparison, discrepancy, fit.residual, fit.slopes)
    budget = [_noise(fit), *(_discrepancy(fit, wave, discrepancy) for wave in found), _scatter(fit)]
    lacks = ["errors of geometry, gauge and load cell"]
    if fit.placed is None:
        lacks.append("where the lattice lies against the stones: only one placement was simulated")
    else:
        budget.append(_placement(fit, fit.placed))
    if modulus_std > 0:
        budget.append(_modulus(fit, modulus_std))
    else:
        lacks.insert(0, "the modulus, of which no uncertainty was given: f_max shifts with it one to one")
    return Uncertainty(fit.minimum.position, confidence, tuple(budget), tuple(lacks))


def curvature_certainty(fit: Fit) -> float:
    """The weakest curvature of the valley over the standard deviation that scatter of the nodes gives it.

    Below about three the intervals rest on a curvature that is itself a matter of chance.
    """
    if fit.by_data:
        return np.inf  # its curvature is a sum of squared slopes: scatter adds to it, and is in the interval
    size = fit.surrogate.upper - fit.surrogate.lower
    curvature, axes = np.linalg.eigh(fit.minimum.hessian * np.outer(size, size))
    along = axes[:, 0] * size
    weights = np.einsum("x,y,xypq->pq", along, along, fit.surrogate.of_nodes().hessian(fit.minimum.position))
    scatter = node_scatter(fit.surrogate)[0] * np.sqrt(np.sum(weights**2))
    return float(curvature[0] / scatter) if scatter > 0 else np.inf


def _noise(fit: Fit) -> Contribution:
    """White measuring noise; the slopes hold no rigid motion, so taking it out of the noise changes nothing."""
    response = fit.response
    parts = []
    if fit.comparison.use_field.any():
        std = np.sqrt(np.mean(fit.comparison.noise[: fit.comparison.field_size])) * fit.comparison.field_scale
        parts.append(f"{std * 1e6:.3g} µm in a displacement component")
    if fit.comparison.use_load.any():
        assert fit.comparison.measured.load_std is not None
        parts.append(f"{np.sqrt(np.mean(np.square(fit.comparison.measured.load_std))):.3g} N in the load")
    sentence = f"white measuring noise of {' and '.join(parts)}"
    return Contribution("noise", sentence, (response * fit.comparison.noise) @ response.T)


def _discrepancy(fit: Fit, wave: Wave, setting: Discrepancy) -> Contribution:
    """The engine's discrepancy in the field or in the load."""
    moved = wave.amplitude * (fit.response @ wave.columns)
    size = (
        f"{wave.amplitude * 1e6:.3g} µm in the field" if wave.kind == "field" else f"{wave.amplitude:.3g} N in the load"
    )
    how = (
        "given"
        if np.isinf(wave.freedom)
        else f"estimated from the residual, {wave.freedom:.1f} effective degrees of freedom"
    )
    sentence = (
        f"difference between model and specimen of {size}, correlated over {setting.length * 1e3:g} mm of CMOD ({how})"
    )
    return Contribution(f"discrepancy_{wave.kind}", sentence, moved @ moved.T, wave.freedom)


def _placement(fit: Fit, placed: np.ndarray) -> Contribution:
    """Where particles lie against the stones: the specimen is one more placement beside those that were averaged."""
    count = len(placed)
    moves = placed @ fit.response.T
    covariance = (1 + 1 / count) * (moves.T @ moves) / (count - 1)
    share = np.sqrt(np.diag(covariance)) / fit.minimum.position
    sentence = (
        f"where the lattice lies against the stones, {share[0]:.2g} of f_max, {share[1]:.2g} of delta_max over "
        f"{count} placements"
    )
    return Contribution("placement", sentence, covariance, float(count - 1))


def _modulus(fit: Fit, relative: float) -> Contribution:
    """The modulus: (K, f_max) → s(K, f_max) leaves the field as it is and multiplies the load by s.

    So a true modulus 1 + ε times the assumed one makes fields look like f_max/(1 + ε), and loads 1 + ε
    times too high for it (scaling law; exact where every strength follows f_max).
    """
    f_max, _ = fit.minimum.position
    shift = np.array([-f_max, 0.0])
    if fit.comparison.use_load.any():
        assert fit.load is not None
        nothing = np.zeros((*fit.comparison.use_field.shape, 2))
        shift = shift + fit.response @ fit.comparison.features(nothing, fit.load.value(fit.minimum.position))
    sentence = f"modulus uncertain by {relative:.2g} of itself (standard deviation)"
    return Contribution("modulus", sentence, relative**2 * np.outer(shift, shift))


def _scatter(fit: Fit) -> Contribution:
    """Crack paths that change from node to node: every node scatters alone, and the optimum with them."""
    if fit.by_data:
        return _scatter_of_data(fit)
    std, freedom = node_scatter(fit.surrogate)
    slopes = fit.surrogate.of_nodes().gradient(fit.minimum.position).reshape(2, -1)
    moved = std * np.linalg.solve(fit.minimum.hessian, slopes)
    unit = " m²" if fit.comparison.objective is Objective.FIELDS else ""
    sentence = f"scatter of the simulations about the multinomial, {std:.2g}{unit} in the objective"
    return Contribution("scatter", sentence, moved @ moved.T, float(freedom))


def _scatter_of_data(fit: Fit) -> Contribution:
    """The same where the multinomials run through the data: what each node's scatter would move the optimum by."""
    moves = replace(fit.features, values=fit.features.values @ fit.response.T)  # (n_f, n_d, 2), N and m
    scatter, freedom = node_covariance(moves)
    weights = fit.features.of_nodes().value(fit.minimum.position)
    covariance = float(np.sum(weights**2)) * scatter
    share = np.sqrt(np.diag(covariance)) / fit.minimum.position
    sentence = (
        f"scatter of the simulations about the multinomials, {share[0]:.2g} of f_max, {share[1]:.2g} of delta_max"
    )
    return Contribution("scatter", sentence, covariance, float(freedom))
