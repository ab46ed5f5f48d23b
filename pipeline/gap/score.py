"""From evidence to probabilities: prior odds, temper, pooling of replicates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

NONE = "none"
UNLISTED = "outside the library"  # an effect that the library lacks
P_NONE = 0.5  # before anything is seen


@dataclass(frozen=True)
class Scored:
    """What the data say of every candidate.

    Parameters
    ----------
    log_bayes : label → natural logarithm of the Bayes factor against none, before tempering
    probability : label → probability after tempering, sum 1
    temperature : float
    """

    log_bayes: Mapping[str, float]
    probability: Mapping[str, float]
    temperature: float

    def ranked(self) -> list[str]:
        """Labels, the most probable first."""
        return sorted(self.probability, key=lambda label: (-self.probability[label], label))

    def first(self) -> str:
        """The most probable label that is none or names effects: a model that predicts something."""
        return next(label for label in self.ranked() if label != UNLISTED)

    def causes(self) -> list[str]:
        """Labels that name effects, the most probable first."""
        return [label for label in self.ranked() if names_of(label)]

    def part(self, name: str) -> float:
        """Probability that an effect takes part, alone or with others."""
        return float(sum(p for label, p in self.probability.items() if name in names_of(label)))

    def credible(self, share: float = 0.9) -> list[str]:
        """The fewest labels whose probabilities sum to the share."""
        found, total = [], 0.0
        for label in self.ranked():
            found.append(label)
            total += self.probability[label]
            if total >= share - 1e-12:
                break
        return found


def names_of(label: str) -> tuple[str, ...]:
    """The effects that a label names; none where it is `NONE` or `UNLISTED`."""
    return () if label in (NONE, UNLISTED) else tuple(label.split(" + "))


def order_of(label: str) -> int:
    """How many effects a label stands for: one that the library lacks is as probable beforehand as one that it has."""
    return 1 if label == UNLISTED else len(names_of(label))


def inclusion(effects: int) -> float:
    """Prior odds of one effect where each of so many is there or not by itself, and none with `P_NONE`.

    (1 + odds)^−effects = P_NONE; a pair then has the odds of its members multiplied.
    """
    return float(P_NONE ** (-1 / max(effects, 1)) - 1)


def score(log_evidence: Mapping[str, float], effects: int, temperature: float = 1.0) -> Scored:
    """Probabilities of candidates.

    Parameters
    ----------
    log_evidence : label → from `fit`; must hold "none"
    effects : int; in the library, tested
    temperature : float, at least 1; log Bayes factors are divided by it: what simulators leave is less independent
        than Σ says (calibrated on tests of another engine)
    """
    log_bayes = {label: log_evidence[label] - log_evidence[NONE] for label in log_evidence}
    return from_bayes(log_bayes, effects, temperature)


def from_bayes(log_bayes: Mapping[str, float], effects: int, temperature: float = 1.0) -> Scored:
    """Probabilities from log Bayes factors; arguments as of `score`. What the library lacks is one effect more."""
    odds = np.log(inclusion(effects + (UNLISTED in log_bayes)))
    weight = np.array([log_bayes[label] / temperature + order_of(label) * odds for label in log_bayes])
    share = np.exp(weight - weight.max())
    share /= share.sum()
    return Scored(dict(log_bayes), dict(zip(log_bayes, share.tolist(), strict=True)), temperature)


def pooled(replicates: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The median log Bayes factor of every candidate that all replicates have.

    Not the sum: what one engine leaves out for all specimens alike would be counted as often as there are specimens.
    """
    common = set.intersection(*(set(r) for r in replicates))
    return {label: float(np.median([r[label] for r in replicates])) for label in replicates[0] if label in common}


def pairs(singles: Scored, best: int = 3) -> list[tuple[str, str]]:
    """The pairs of the most probable single effects."""
    top = singles.causes()[:best]
    return sorted((min(a, b), max(a, b)) for i, a in enumerate(top) for b in top[i + 1 :])
