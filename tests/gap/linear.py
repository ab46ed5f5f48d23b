"""Linear explanations with Gaussian noise: everything about them is known in closed form."""

from __future__ import annotations

import numpy as np

from pipeline.gap.candidate import Candidate
from pipeline.gap.effect import Magnitude
from pipeline.gap.fit import Data
from pipeline.gap.metric import Metric

WIDE = Magnitude(-50.0, 50.0, 1.5, "1")  # bounds so far off that the prior is normal
BOX = np.array([[-40.0, 40.0], [-40.0, 40.0]])


def candidate(base: np.ndarray, name: str, column: np.ndarray, magnitude: Magnitude = WIDE) -> Candidate:
    """y = base·λ + column·a."""
    return Candidate((name,), (magnitude,), lambda x, a: base @ x + column * a[0])


def none(base: np.ndarray) -> Candidate:
    """y = base·λ."""
    return Candidate((), (), lambda x, a: base @ x)


def covariance(n: int, rng: np.random.Generator) -> np.ndarray:
    """Noise and a few long waves."""
    waves = rng.normal(size=(n, 3))
    return np.diag(rng.uniform(0.5, 2.0, n)) + waves @ waves.T


def data(target: np.ndarray, sigma: np.ndarray) -> Data:
    return Data(target, Metric(sigma), BOX)


def exact_log_bayes(target: np.ndarray, sigma: np.ndarray, base: np.ndarray, column: np.ndarray, scale: float) -> float:
    """Against none: both Gaussian after the flat parameters are integrated out (restricted likelihood)."""
    return restricted(target, sigma + scale**2 * np.outer(column, column), base) - restricted(target, sigma, base)


def factor_log_bayes(target: np.ndarray, sigma: np.ndarray, base: np.ndarray, more: np.ndarray) -> float:
    """Of a further covariance, against none; the same way."""
    return restricted(target, sigma + more, base) - restricted(target, sigma, base)


def restricted(y: np.ndarray, cov: np.ndarray, base: np.ndarray) -> float:
    """Log density of what is left when the flat parameters are integrated out, but for a constant."""
    inverse = np.linalg.inv(cov)
    normal = base.T @ inverse @ base
    project = inverse - inverse @ base @ np.linalg.solve(normal, base.T @ inverse)
    return -0.5 * (y @ project @ y + np.linalg.slogdet(cov)[1] + np.linalg.slogdet(normal)[1])
