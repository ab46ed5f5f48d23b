"""What could be told apart, before anything is judged: detectability, detection limits, equivalence classes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from pipeline.gap.candidate import Candidate
from pipeline.gap.fit import Data, jacobian
from pipeline.gap.metric import doubted

DETECTED = 3.0  # d′ from which an effect counts as detectable: one wrong in 700 either way, none of twenty by chance
APART = 2.0  # d′ that must remain against a competitor for two effects to be told apart
OFTEN = 4.0  # detection limits at which classes are looked at, capped at the plausible maximum


@dataclass(frozen=True, eq=False)
class Card:
    """The identifiability of effects in one test.

    Parameters
    ----------
    names : tuple of n effects, sorted
    limit : (n,) array; value from which an effect is detected, inf where no plausible one is
    d_prime : (n,) array; at the plausible maximum, (f_max, δ_max) refitted
    looked_at : (n,) array; value at which effects are held against each other
    remaining : (n, n) array; d′ of the row's effect at that value after the column's effect has been refitted too
    classes : tuple of tuples of names; detectable effects that these data do not tell apart
    """

    names: tuple[str, ...]
    limit: np.ndarray
    d_prime: np.ndarray
    looked_at: np.ndarray
    remaining: np.ndarray
    classes: tuple[tuple[str, ...], ...]

    @property
    def hidden(self) -> tuple[str, ...]:
        """Effects of which no plausible size would be detected."""
        return tuple(n for n, limit in zip(self.names, self.limit, strict=True) if not np.isfinite(limit))

    def class_of(self, name: str) -> tuple[str, ...]:
        """The class of an effect, itself alone where it has no mates."""
        return next((c for c in self.classes if name in c), (name,))


@dataclass(frozen=True, eq=False)
class _Signal:
    """What an effect changes, white, and how uncertain that is, along each of its directions and signs."""

    candidate: Candidate
    data: Data
    at: np.ndarray
    none: np.ndarray
    slopes: np.ndarray  # (n, q), white, by the parameters

    def change(self, amplitudes: np.ndarray) -> np.ndarray:
        return self.data.metric.white(self.candidate.predict(self.at, amplitudes) - self.none)

    def doubt(self, amplitudes: np.ndarray) -> np.ndarray | None:
        return self.data.doubt(self.candidate, amplitudes)

    def left(self, change: np.ndarray, doubt: np.ndarray | None) -> np.ndarray:
        """What the parameters cannot make up of a change (n,) or (n, k), counted where data are so uncertain."""
        base = np.linalg.qr(doubted(self.slopes, doubt))[0]
        seen = doubted(change, doubt)
        return np.asarray(seen - base @ (base.T @ seen))

    def of(self, amplitudes: np.ndarray) -> np.ndarray:
        return self.left(self.change(amplitudes), self.doubt(amplitudes))

    def weakest(self, value: float) -> float:
        """d′ of the direction and sign of a size that is seen least."""
        return min(float(np.linalg.norm(self.of(a))) for a in self.all(value))

    def all(self, value: float) -> list[np.ndarray]:
        """Amplitudes for every direction and sign of a size."""
        size = self.candidate.magnitudes[0]
        if size.directions == 2:
            along = [self.of(value * np.eye(2)[i]) for i in (0, 1)]
            _, _, right = np.linalg.svd(np.column_stack(along), full_matrices=False)
            return [value * row for row in right]
        return [np.array([sign * value]) for sign in (1, -1) if size.low <= sign * value <= size.high]


def card(candidates: Mapping[str, Candidate], data: Data, parameters: np.ndarray, temperature: float = 1.0) -> Card:
    """What could be told apart at these parameters.

    d′ = ‖(I − P) L⁻¹ Δy‖ with Δy the change of the data by the effect, L Lᵀ the covariance with what is uncertain in
    that change itself, and P the projector onto what a change of (f_max, δ_max) does (Macmillan and Creelman 2005, for
    the ideal observer of a known signal). Tempering divides by √temperature. Against a competitor its best amplitude,
    within its bounds, is taken off too, in the same metric; the change is taken as linear in that amplitude.

    Parameters
    ----------
    candidates : name → Candidate of that one effect
    data : Data; only metric and box are used
    parameters : (q,) array
    temperature : float
    """
    names = tuple(sorted(candidates))
    signals = [_signal(candidates[n], data, parameters) for n in names]
    root = np.sqrt(temperature)
    largest = np.array([s.candidate.magnitudes[0].high for s in signals])
    d_prime = np.array([s.weakest(m) for s, m in zip(signals, largest, strict=True)]) / root
    limit = np.array([_limit(s, m, root) for s, m in zip(signals, largest, strict=True)])
    at = np.where(np.isfinite(limit), np.minimum(OFTEN * np.where(np.isfinite(limit), limit, 0), largest), largest)
    remaining = np.array([[_remaining(s, v, o) for o in signals] for s, v in zip(signals, at, strict=True)]) / root
    np.fill_diagonal(remaining, 0.0)
    return Card(names, limit, d_prime, at, remaining, classes(names, limit, remaining))


def _signal(candidate: Candidate, data: Data, parameters: np.ndarray) -> _Signal:
    none = np.zeros(len(candidate.bounds))
    at = np.append(parameters, none)
    slopes = jacobian(candidate, data, at, np.arange(len(data.box)))
    return _Signal(candidate, data, parameters, candidate.predict(parameters, none), slopes)


def _limit(signal: _Signal, largest: float, root: float) -> float:
    """The smallest size with d′ = `DETECTED`, by bisection; inf where even the largest has less."""

    def seen(value: float) -> bool:
        return signal.weakest(value) >= DETECTED * root

    if not seen(largest):
        return float("inf")
    low, high = 0.0, largest
    while high - low > 1e-3 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if seen(middle) else (middle, high)
    return high


def _remaining(signal: _Signal, value: float, competitor: _Signal) -> float:
    """The least that a competitor leaves of an effect of this size, whatever its direction and sign.

    Data count as little as both doubt them.
    """
    size = competitor.candidate.magnitudes[0]
    found: list[float] = []
    for amplitudes in signal.all(value):
        change, doubt = signal.change(amplitudes), signal.doubt(amplitudes)
        if size.directions == 2:
            trials = [competitor.change(size.high * row) for row in np.eye(2)]
            basis, left = signal.left(np.column_stack(trials), doubt), signal.left(change, doubt)
            found.append(float(np.linalg.norm(left - basis @ np.linalg.lstsq(basis, left, rcond=None)[0])))
            continue
        for other in competitor.all(size.high):
            trial = competitor.change(other)
            share, _ = _taken(signal.left(change, doubt), signal.left(trial, doubt))
            both = joined(doubt, competitor.doubt(share * other))
            found.append(_taken(signal.left(change, both), signal.left(trial, both))[1])
    return min(found)


def _taken(change: np.ndarray, trial: np.ndarray) -> tuple[float, float]:
    """The share, none to one, of a trial that takes most off a change, and how much is left."""
    power = float(trial @ trial)
    share = float(np.clip(trial @ change / power, 0.0, 1.0)) if power > 0 else 0.0
    return share, float(np.linalg.norm(change - share * trial))


def joined(*doubts: np.ndarray | None) -> np.ndarray | None:
    """Several doubts (n, j) as one; None: none."""
    some = [doubt for doubt in doubts if doubt is not None]
    return np.hstack(some) if some else None


def classes(names: tuple[str, ...], limit: np.ndarray, remaining: np.ndarray) -> tuple[tuple[str, ...], ...]:
    """Detectable effects in groups of which no two are told apart (complete linkage: no chains)."""
    seen = np.flatnonzero(np.isfinite(limit))
    if seen.size < 2:
        return ()
    apart = np.maximum(remaining, remaining.T)[np.ix_(seen, seen)]
    group = fcluster(linkage(squareform(apart, checks=False), "complete"), APART, "distance")
    found = [tuple(names[i] for i in seen[group == g]) for g in np.unique(group)]
    return tuple(sorted(c for c in found if len(c) > 1))
