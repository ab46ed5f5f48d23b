"""Candidates: explanations of a test, each a function of the two parameters and of the amplitudes of its effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.gap.effect import Magnitude

Predict = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Parameters (q,) and amplitudes (k,) → data (n,)."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One explanation.

    Parameters
    ----------
    names : tuple of effects' names; empty: the model as it is
    magnitudes : tuple of Magnitude, one an effect
    predict : Predict; with zero amplitudes the model as it is
    doubt : amplitudes (k,) → (n, j) array B of the data: the prediction is uncertain by B Bᵀ there
    """

    names: tuple[str, ...]
    magnitudes: tuple[Magnitude, ...]
    predict: Predict
    doubt: Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def label(self) -> str:
        """As results call it."""
        return " + ".join(self.names) or "none"

    @property
    def components(self) -> tuple[Magnitude, ...]:
        """One magnitude an amplitude: an effect with an unknown direction has two."""
        return tuple(m for m in self.magnitudes for _ in range(m.directions))

    @property
    def bounds(self) -> np.ndarray:
        """Of the amplitudes; (k, 2)."""
        return np.array([m.bounds for m in self.components]).reshape(-1, 2)

    def log_prior(self, amplitudes: np.ndarray) -> np.ndarray:
        """Logarithm of the prior density of amplitudes (..., k)."""
        rows = [m.log_density(amplitudes[..., i]) for i, m in enumerate(self.components)]
        return np.sum(rows, axis=0) if rows else np.zeros(amplitudes.shape[:-1])

    def values(self, amplitudes: np.ndarray) -> np.ndarray:
        """One value an effect (..., effects) from amplitudes (..., k): lengths where there are directions."""
        found, at = [], 0
        for m in self.magnitudes:
            part = amplitudes[..., at : at + m.directions]
            found.append(part[..., 0] if m.directions == 1 else np.linalg.norm(part, axis=-1))
            at += m.directions
        return np.stack(found, axis=-1) if found else np.zeros((*amplitudes.shape[:-1], 0))
