"""Fit of a candidate: the two parameters always refitted, amplitudes within their bounds, and the evidence for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import logsumexp, ndtri

from pipeline.gap.candidate import Candidate
from pipeline.gap.metric import Metric, doubted, doubting

STEP = 1e-3  # of the box, and of an amplitude's scale: central differences
COARSE, FINE, REACH = 13, 25, 5.0  # nodes over the bounds; nodes over ± REACH standard deviations
STARTS = 3  # nodes along each of two or more amplitudes, to start from
FAR = np.array([6.0, 7.0, 8.0, 10.0, 13.0, 18.0, 25.0])  # further nodes, for tempered likelihoods
CHORDS, SETTLED = 8, 1e-2  # steps of the parameters at a node, until χ² falls by less
RULER = {2: 11, 3: 7}  # nodes along each principal axis of so many amplitudes; 5 of more


@dataclass(frozen=True, eq=False)
class Data:
    """What is explained.

    Parameters
    ----------
    target : (n,) array
    metric : Metric of the same data
    box : (q, 2) array; bounds of the parameters, their flat prior
    """

    target: np.ndarray
    metric: Metric
    box: np.ndarray

    @property
    def width(self) -> np.ndarray:
        return self.box[:, 1] - self.box[:, 0]

    def residual(self, candidate: Candidate, at: np.ndarray) -> np.ndarray:
        """White target − prediction (n,) at parameters and amplitudes (q + k,)."""
        q = len(self.box)
        return self.metric.white(self.target - candidate.predict(at[:q], at[q:]))

    def doubt(self, candidate: Candidate, amplitudes: np.ndarray) -> np.ndarray | None:
        """White columns (n, j) by which a candidate itself is uncertain; None: by nothing."""
        found = None if candidate.doubt is None else candidate.doubt(amplitudes)
        return None if found is None or not found.size else self.metric.white(found)


@dataclass(frozen=True, eq=False)
class Fitted:
    """The best point of a candidate, and its posterior on nodes.

    Parameters
    ----------
    candidate : Candidate
    parameters : (q,) array
    amplitudes : (k,) array
    chi_square : float
    log_evidence : float; natural logarithm of ∫∫ likelihood × prior, without the constant that all share
    nodes : (j, k) array; amplitudes
    weights : (j,) array, sum 1; their posterior, the parameters integrated out
    log_measure : (j,) array; logarithm of prior density × length or area that a node stands for
    jacobian : (n, q + k) array; white derivatives of the prediction at the best point
    residual : (n,) array; white
    at_edge : bool; the parameters lie on the edge of their box
    """

    candidate: Candidate
    parameters: np.ndarray
    amplitudes: np.ndarray
    chi_square: float
    log_evidence: float
    nodes: np.ndarray
    weights: np.ndarray
    log_measure: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray
    at_edge: bool

    def values(self, temperature: float = 1.0) -> np.ndarray:
        """Posterior mean of every effect's value; (effects,)."""
        return self.tempered(temperature) @ self.candidate.values(self.nodes)

    def interval(self, share: float = 0.95, temperature: float = 1.0) -> np.ndarray:
        """Bounds (effects, 2) between which the values lie with this probability."""
        values, weights = self.candidate.values(self.nodes), self.tempered(temperature)
        tail = (1 - share) / 2
        return np.array([_quantiles(v, weights, (tail, 1 - tail)) for v in values.T]).reshape(-1, 2)

    def parameter_interval(self, share: float = 0.95, temperature: float = 1.0) -> np.ndarray:
        """Bounds (q, 2) of the parameters, normal about the best point, amplitudes free within their prior."""
        pull = np.concatenate([np.zeros(self.parameters.size), [1 / m.scale for m in self.candidate.components]])
        rows = np.vstack([self.jacobian / np.sqrt(temperature), np.diag(pull)[self.parameters.size :]])
        unit = np.linalg.norm(rows, axis=0)
        unit = np.where(unit > 0, unit, 1.0)  # what the data do not see at all has no bound that matters here
        std = np.sqrt(np.diag(np.linalg.pinv((rows / unit).T @ (rows / unit), rcond=1e-12)))[: self.parameters.size]
        half = ndtri(0.5 + share / 2) * std / unit[: self.parameters.size]
        return self.parameters[:, None] + half[:, None] * (-1.0, 1.0)

    def tempered(self, temperature: float) -> np.ndarray:
        """The weights (j,) when the likelihood counts only to the power of 1/temperature."""
        if temperature == 1:
            return self.weights
        log_likelihood = np.log(np.maximum(self.weights, 1e-300)) - self.log_measure
        log_weight = log_likelihood / temperature + self.log_measure
        weight = np.exp(log_weight - log_weight.max())
        return weight / weight.sum()


def fit(candidate: Candidate, data: Data, start: np.ndarray | None = None) -> Fitted:
    """Fit a candidate and integrate its likelihood.

    The parameters are integrated out by Laplace's method at every node of the amplitudes (they are nearly linear), the
    amplitudes by quadrature over their bounds, nodes lying dense around the best point: so an effect that the data
    hardly see keeps its prior, and one at its bound is cut there.

    Parameters
    ----------
    candidate : Candidate
    data : Data
    start : (q,) array; parameters to start from, the middle of the box where not given
    """
    best = best_point(candidate, data, start)
    at, square, jacobian, residual = best
    nodes, log_area = _nodes(candidate, data, best)
    profile = _profile(candidate, data, best)
    profiles = np.array([profile(node) for node in nodes])
    log_measure = candidate.log_prior(nodes) + log_area
    log_posterior = profiles + log_measure
    total = float(logsumexp(log_posterior))
    q = len(data.box)
    return Fitted(
        candidate=candidate,
        parameters=at[:q],
        amplitudes=at[q:],
        chi_square=square,
        log_evidence=total - float(np.log(data.width).sum()),
        nodes=nodes,
        weights=np.exp(log_posterior - total),
        log_measure=log_measure,
        jacobian=jacobian,
        residual=residual,
        at_edge=bool(np.any(np.abs(at[:q, None] - data.box) < 1e-6 * data.width[:, None])),
    )


Point = tuple[np.ndarray, float, np.ndarray, np.ndarray]  # parameters and amplitudes, χ², Jacobian, residual


def best_point(candidate: Candidate, data: Data, start: np.ndarray | None = None) -> Point:
    """Where a candidate fits best, from several starts; arguments as of `fit`."""
    centre = data.box.mean(axis=1) if start is None else np.asarray(start, float)
    k = len(candidate.bounds)
    best = climbed(candidate, data, np.append(centre, np.zeros(k)))
    for node in _coarse(candidate, STARTS + 2 if k == 1 else STARTS):
        found = climbed(candidate, data, np.append(_profiled(best, data), node))
        best = min(best, found, key=lambda point: _cost(candidate, data, point))
    return best


def _cost(candidate: Candidate, data: Data, point: Point) -> float:
    """χ² less twice the logarithm of the prior: what is smallest at the best point."""
    return point[1] - 2 * float(candidate.log_prior(point[0][len(data.box) :]))


def _profiled(point: Point, data: Data) -> np.ndarray:
    return point[0][: len(data.box)]


def _coarse(candidate: Candidate, count: int) -> list[np.ndarray]:
    lines = [np.linspace(low, high, count + 2)[1:-1] for low, high in candidate.bounds]
    return [np.array(node) for node in product(*lines)] if lines else []


def jacobian(candidate: Candidate, data: Data, at: np.ndarray, free: np.ndarray) -> np.ndarray:
    """White central differences of the prediction with respect to some of its arguments; (n, free)."""
    q, steps = len(data.box), STEP * _scales(candidate, data)
    columns = []
    for i in free:
        low, high = at.copy(), at.copy()
        low[i], high[i] = at[i] - steps[i], at[i] + steps[i]
        rise = candidate.predict(high[:q], high[q:]) - candidate.predict(low[:q], low[q:])
        columns.append(rise / (2 * steps[i]))
    return data.metric.white(np.column_stack(columns)) if columns else np.zeros((data.target.size, 0))


def _scales(candidate: Candidate, data: Data) -> np.ndarray:
    """By how much each argument may plausibly vary; (q + k,)."""
    return np.concatenate([data.width, [min(m.scale, m.high) for m in candidate.components]])


def climbed(candidate: Candidate, data: Data, at: np.ndarray, turns: int = 12) -> Point:
    """Gauss–Newton from `at` (q + k,) with bounds and step halving; the prior draws amplitudes to none."""
    q = len(data.box)
    free = np.arange(at.size)
    bounds = np.vstack([data.box, candidate.bounds])
    pull = np.concatenate([np.zeros(q), [1 / m.scale for m in candidate.components]])
    unit = _scales(candidate, data)[free]
    residual = data.residual(candidate, at)
    cost = residual @ residual + np.sum((pull * at) ** 2)
    slopes = jacobian(candidate, data, at, free)
    for _ in range(turns):
        scaled = slopes * unit
        normal = scaled.T @ scaled + np.diag((pull[free] * unit) ** 2)
        normal[np.diag_indices_from(normal)] += 1e-12 * np.trace(normal)
        step = unit * np.linalg.solve(normal, scaled.T @ residual - unit * pull[free] ** 2 * at[free])
        for halving in range(6):
            moved = at.copy()
            moved[free] = np.clip(at[free] + step / 2**halving, *bounds[free].T)
            left = data.residual(candidate, moved)
            now = left @ left + np.sum((pull * moved) ** 2)
            if now < cost:
                break
        else:
            break
        gained, at, residual, cost = cost - now, moved, left, now
        slopes = jacobian(candidate, data, at, free)
        if gained < 1e-4:
            break
    return at, float(residual @ residual), slopes, residual


def _profile(candidate: Candidate, data: Data, best: Point) -> Callable[[np.ndarray], float]:
    """log ∫ likelihood over the parameters by Laplace, as a function of the amplitudes held.

    The parameters follow by chords, with the derivatives of the best point, in which they are nearly linear; data count
    as little as the candidate doubts them at these amplitudes.
    """
    at, _, slopes, _ = best
    q = len(data.box)
    free, bound = slopes[:, :q], slopes[:, q:]
    follow = _chord(free, data) @ bound

    def profile(node: np.ndarray) -> float:
        doubt = data.doubt(candidate, node)
        told = doubting(doubt)
        seen = told(free)
        solve = _chord(seen, data)
        here = np.append(at[:q] - follow @ (node - at[q:]), node)
        here[:q] = np.clip(here[:q], *data.box.T)
        residual = data.residual(candidate, here)
        for _ in range(CHORDS):
            moved = here.copy()
            moved[:q] = np.clip(here[:q] + solve @ told(residual), *data.box.T)
            left = data.residual(candidate, moved)
            gained = _square(told(residual)) - _square(told(left))
            if gained <= 0:
                break
            here, residual = moved, left
            if gained < SETTLED:
                break
        volume = 0.5 * q * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(seen.T @ seen)[1]
        return data.metric.log_likelihood(residual, doubt) + float(volume)

    return profile


def _chord(free: np.ndarray, data: Data) -> np.ndarray:
    """What takes a white residual (n,) to a step of the parameters; (q, n)."""
    return np.asarray(np.linalg.pinv(free * data.width, rcond=1e-9) * data.width[:, None])


def _square(values: np.ndarray) -> float:
    return float(values @ values)


def _nodes(candidate: Candidate, data: Data, best: Point) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes (j, k) for the quadrature, and the logarithm of the length or area that each stands for."""
    at, _, slopes, _ = best
    q, k = len(data.box), len(candidate.bounds)
    if k == 0:
        return np.zeros((1, 0)), np.zeros(1)
    unit = _scales(candidate, data)
    prior = np.concatenate([np.zeros(q), [1 / m.scale**2 for m in candidate.components]]) * unit**2
    scaled = doubted(slopes, data.doubt(candidate, at[q:])) * unit
    covariance = (np.linalg.inv(scaled.T @ scaled + np.diag(prior)) * np.outer(unit, unit))[q:, q:]
    if k == 1:
        low, high = candidate.bounds[0]
        ruler = np.concatenate([REACH * np.linspace(-1, 1, FINE), FAR, -FAR])
        fine = at[q] + np.sqrt(covariance[0, 0]) * ruler
        line = np.unique(np.concatenate([np.linspace(low, high, COARSE), fine[(fine > low) & (fine < high)], at[q:]]))
        return line[:, None], np.log(np.maximum(np.gradient(line) * _ends(line.size), 1e-300))
    strength, shape = np.linalg.eigh(covariance)
    axes = shape * np.sqrt(strength)
    ruler = REACH * np.linspace(-1, 1, RULER.get(k, 5))
    grid = np.array(list(product(ruler, repeat=k))) @ axes.T + at[q:]
    inside = np.all((grid >= candidate.bounds[:, 0]) & (grid <= candidate.bounds[:, 1]), axis=1)
    nodes = grid[inside] if inside.any() else at[None, q:]
    area = k * np.log(ruler[1] - ruler[0]) + 0.5 * np.log(strength).sum()
    return nodes, np.full(len(nodes), area)


def _ends(count: int) -> np.ndarray:
    """Half a step at either end: trapezoids."""
    weight = np.ones(count)
    weight[[0, -1]] = 0.5
    return weight


def _quantiles(values: np.ndarray, weights: np.ndarray, shares: tuple[float, float]) -> list[float]:
    order = np.argsort(values)
    passed = np.cumsum(weights[order]) - 0.5 * weights[order]
    return [float(np.interp(share, passed, values[order])) for share in shares]
