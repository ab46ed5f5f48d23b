"""The temperature of a library's probabilities, from tests whose truth is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.gap.score import NONE, Scored, from_bayes

TEMPERATURES = np.geomspace(1.0, 60.0, 83)  # that are tried: steps of a twentieth
LEAST = 1e-3  # probability that one answer counts with at least: labels that were not scored are not impossible


@dataclass(frozen=True)
class Answer:
    """One diagnosed test of known truth.

    Parameters
    ----------
    group : int; its specimen: answers of one are not independent
    truth : label that is right
    log_bayes : label → log Bayes factor against none
    tested : int; effects
    """

    group: int
    truth: str
    log_bayes: Mapping[str, float]
    tested: int

    def scored(self, temperature: float) -> Scored:
        """Probabilities at a temperature."""
        return from_bayes(self.log_bayes, self.tested, temperature)

    def log_score(self, temperature: float) -> float:
        """Logarithm of the probability of the truth."""
        return float(np.log(max(self.scored(temperature).probability.get(self.truth, 0.0), LEAST)))


@dataclass(frozen=True)
class Calibration:
    """What answers say of the temperature.

    Parameters
    ----------
    temperature : float; of the best log score
    tests : int
    log_score : float; mean, at it
    cross : float; mean log score of every specimen at the temperature that the others ask for
    cold : float; mean log score at a temperature of one
    """

    temperature: float
    tests: int
    log_score: float
    cross: float
    cold: float


def calibrated(answers: Sequence[Answer]) -> Calibration:
    """The temperature of the best log score; tests with and without effects count alike, as they do in the prior.

    Parameters
    ----------
    answers : of at least two specimens
    """
    table = np.array([[a.log_score(t) for t in TEMPERATURES] for a in answers])
    weight = weights(answers)
    group = np.array([a.group for a in answers])
    cross = np.zeros(len(answers))
    for one in np.unique(group):
        out = group == one
        cross[out] = table[out][:, int(np.argmax(weight[~out] @ table[~out]))]
    mean = weight @ table
    best = int(np.argmax(mean))
    return Calibration(
        float(TEMPERATURES[best]), len(answers), float(mean[best]), float(weight @ cross), float(mean[0])
    )


def weights(answers: Sequence[Answer]) -> np.ndarray:
    """Weights (n,), sum 1: half for tests without effects, half for those with, where there are both."""
    free = np.array([a.truth == NONE for a in answers])
    shares = np.where(free, 1 / max(free.sum(), 1), 1 / max((~free).sum(), 1))
    return np.asarray(shares / shares.sum())


def expected_error(answers: Sequence[Answer], temperature: float, bins: int = 5) -> float:
    """Expected calibration error of the most probable answer: mean |stated − right| over bins of equal count.

    Tests with and without effects count alike, as in `calibrated`.
    """
    top = [(s.probability[s.ranked()[0]], s.ranked()[0] == a.truth) for a in answers for s in [a.scored(temperature)]]
    stated, right = np.array(top, float).T
    weight = weights(answers)
    parts = np.array_split(np.lexsort((right, stated)), min(bins, len(top)))
    return float(sum(abs(weight[p] @ (stated[p] - right[p])) for p in parts))
