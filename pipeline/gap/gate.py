"""The gate: does any candidate fit as well as the library of discrepancies says that a complete model should?"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import stats

from pipeline.gap.modes import LOAD, MODES, REMAINDER, amplitudes, shapes
from pipeline.gap.observation import Observation

RARE = 0.01  # share of complete models that the gate refuses


@dataclass(frozen=True)
class Gate:
    """How well the best candidate fits, mode by mode.

    Parameters
    ----------
    ratio : mode → χ² over its degrees of freedom
    limit : mode → what a complete model exceeds in one of a hundred tests, all modes together
    freedom : mode → degrees of freedom
    """

    ratio: dict[str, float]
    limit: dict[str, float]
    freedom: dict[str, int] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[str, ...]:
        """Modes that are fitted too badly, the worst first."""
        wrong = [m for m in self.ratio if self.ratio[m] > self.limit[m]]
        return tuple(sorted(wrong, key=lambda m: -self.ratio[m] / self.limit[m]))

    @property
    def passed(self) -> bool:
        return not self.failed


def mode_operators(observation: Observation) -> dict[str, np.ndarray]:
    """Mode → operator (j, n) that takes the data that are there to what the mode has of them.

    Modes and load have one row a station; the remainder has a row for every displacement, and fewer degrees of
    freedom.
    """
    o = observation
    s, p = o.sight.cmod.size, len(o.sight.points)
    use = o.mask[: 2 * s * p : 2].reshape(s, p)
    take = amplitudes(o.sight, use)
    stations = np.flatnonzero(use.sum(axis=1) >= len(MODES) / 2)
    found: dict[str, np.ndarray] = {}
    cut = 2 * s * p
    if stations.size:
        whole = np.zeros((len(MODES), stations.size, cut + s))
        for row, station in enumerate(stations):
            whole[:, row, 2 * p * station : 2 * p * (station + 1)] = take[station]
        found = dict(zip(MODES, whole[:, :, o.mask], strict=True))
        basis = shapes(o.sight).reshape(2 * p, len(MODES))
        left = np.zeros((cut, cut + s))
        for station in stations:
            block = slice(2 * p * station, 2 * p * (station + 1))
            seen = np.repeat(use[station], 2)
            left[block, block] = np.diag(seen.astype(float)) - np.where(seen[:, None], basis @ take[station], 0.0)
        found[REMAINDER] = left[o.mask[:cut]][:, o.mask]
    loads = np.flatnonzero(o.mask[cut:])
    if loads.size:
        rows = np.zeros((loads.size, cut + s))
        rows[np.arange(loads.size), cut + loads] = 1.0
        found[LOAD] = rows[:, o.mask]
    return found


def gate(observation: Observation, residual: np.ndarray, covariance: np.ndarray, tail: float) -> Gate:
    """Judge what the best candidate leaves.

    χ²ₘ = bᵀ C⁺ b of the mode's amplitudes b, C their covariance. As Σ was learnt from few specimens, and these differ
    in how much they differ, χ² over degrees of freedom follows F rather than χ² (Hotelling 1931); the share of false
    refusals is divided among the modes.

    Parameters
    ----------
    observation : Observation
    residual : (n,) array; data − prediction of the best candidate, in the units of the data
    covariance : (n, n) array Σ
    tail : float; second degrees of freedom of F
    """
    operators = mode_operators(observation)
    ratio, limit, count = {}, {}, {}
    for mode, operator in operators.items():
        square, freedom = _quadratic(operator @ residual, operator @ covariance @ operator.T)
        ratio[mode], count[mode] = square / freedom, freedom
        limit[mode] = float(stats.f.ppf(1 - RARE / len(operators), freedom, tail))
    return Gate(ratio, limit, count)


def _quadratic(value: np.ndarray, covariance: np.ndarray) -> tuple[float, int]:
    """bᵀ C⁺ b and the rank of C."""
    strength, shape = np.linalg.eigh(covariance)
    kept = strength > 1e-9 * strength[-1]
    return float(np.sum((shape[:, kept].T @ value) ** 2 / strength[kept])), int(kept.sum())
