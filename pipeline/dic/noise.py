"""What noise explains: thresholds of a good match, learnt from the pictures themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

PARAMETERS = 8  # of a match: six of the warp, brightness and contrast
_SCORE_MEDIAN = 10.5  # of the score test's maximum over all lines under white noise, 25 px subsets
_SCORE_TRIGGER = 22.0  # exceeded by 1 % of the subsets under white noise
_SCORE_REFUSE = 34.0  # exceeded by 1 in 10⁵
_SIGMAS = 6.0


_GRADIENT_NOISE = 1.3923  # variance of a cubic spline's slope at the pixels under white noise of variance 1


def deviation(covariance: np.ndarray, count: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Standard deviations (n, 2) of u and v, px.

    The Cramér–Rao bound σ √(H⁻¹), with H from gradients that are noisy themselves: noise adds to H what does not
    help, and the estimate scatters as if that share were missing (errors in variables; Fuller 1987, ch. 1).

    Parameters
    ----------
    covariance : (n, 2) array, 1/(grey/px)²; diagonal of H⁻¹
    count : (n,) array; pixels
    variance : (n,) array, grey²; of reference minus matched grey value, half of it from the reference
    """
    wasted = _GRADIENT_NOISE * 0.5 * (variance * count)[:, None] * covariance
    return np.sqrt(np.maximum(covariance, 0) * variance[:, None]) / np.maximum(1 - wasted, 0.1)


@dataclass(frozen=True)
class MatchNoise:
    """The scatter of matched grey values in sound subsets.

    Parameters
    ----------
    variance : float, grey²; of reference minus matched grey value of one pixel
    excess : float ≥ 1; how much wider the variance scatters from subset to subset than white noise makes it
    score : float ≥ 1; how much larger the score test comes out than under white noise
    """

    variance: float
    excess: float
    score: float

    @classmethod
    def learnt(cls, residual: np.ndarray, count: np.ndarray, score: np.ndarray) -> MatchNoise:
        """From Σe² (n,), pixels (n,) and score tests (n,) of converged points, most of which are sound."""
        variance = residual / np.maximum(count - PARAMETERS, 1)
        middle = float(np.median(variance))
        below = middle - np.quantile(variance, 0.16)  # the lower half is free of cracks
        white = middle * np.sqrt(2 / max(float(np.median(count)) - PARAMETERS, 1))
        scale = float(np.median(score)) / _SCORE_MEDIAN
        return cls(max(middle, 1e-12), max(1.0, float(below / max(white, 1e-12))), max(1.0, scale))

    def at_least(self, variance: float) -> MatchNoise:
        """The same noise, but not below a variance (grey²)."""
        return replace(self, variance=max(self.variance, variance))

    def limit(self, count: np.ndarray) -> np.ndarray:
        """Greatest variance (grey²) that noise explains in subsets of `count` pixels (n,)."""
        return self.variance * (1 + _SIGMAS * self.excess * np.sqrt(2 / np.maximum(count - PARAMETERS, 1)))

    @property
    def suspicious(self) -> float:
        """Score above which a subset is tried with a cut."""
        return _SCORE_TRIGGER * self.score

    @property
    def refused(self) -> float:
        """Score above which a part is not accepted as one piece."""
        return _SCORE_REFUSE * self.score
