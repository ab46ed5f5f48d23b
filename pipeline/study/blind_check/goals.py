"""The goals of the blind check, set before any was run, and whether a check meets them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

TOGETHER = "together"  # key of the scores of replicates


@dataclass(frozen=True)
class Goal:
    """A score, in words, and between what it is to lie; without bounds it is shown only.

    Parameters
    ----------
    key : of `scores`; below "together" where it begins with that
    says : str
    low, high : float or None
    """

    key: str
    says: str
    low: float | None = None
    high: float | None = None

    @property
    def told(self) -> str:
        """The goal in words."""
        if self.low is not None and self.high is not None:
            return f"{self.low:.2f} to {self.high:.2f}"
        if self.low is not None:
            return f"at least {self.low:.2f}"
        return "none" if self.high is None else f"at most {self.high:.2f}"

    def score(self, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Its value, interval and number of cases in a result."""
        here, _, key = self.key.rpartition(".")
        found: Mapping[str, Any] = (result[here] if here else result)[key]
        return found

    def met(self, result: Mapping[str, Any]) -> bool | None:
        """Whether a result meets it; None where there is no goal or no case."""
        value = self.score(result)["value"]
        if value is None or (self.low is None and self.high is None):
            return None
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)


GOALS = (
    Goal("measurement_top1_at_2_limits", "measurement effects, exact, at 2 detection limits or more", low=0.90),
    Goal("physics_class_top1_at_d_prime_5", "physics effects with d′ ≥ 5, by class", low=0.75),
    Goal("coverage_90", "90 % set holds the truth", low=0.85, high=0.95),
    Goal("set_size", "mean size of the 90 % set", high=6),
    Goal("false_alarm", "false alarms on effect-free tests", high=0.10),
    Goal("free_called_outside", "effect-free tests called outside the library"),
    Goal("ece", "expected calibration error", high=0.10),
    Goal("outside_recall_at_5_limits", "effects outside the library flagged, at 5 detection limits or more", low=0.70),
    Goal("closure_over_oracle", "closure over that of the true effect (median, d′ ≥ 5)", low=0.85),
    Goal(f"{TOGETHER}.class_top1", "four replicates together, by class", low=0.80),
    Goal(f"{TOGETHER}.false_alarm", "false alarms of four replicates together", high=0.05),
    Goal(f"{TOGETHER}.top1", "four replicates together, exact"),
    Goal("top1", "all single effects, exact"),
    Goal("class_top1", "all single effects, by class"),
    Goal("outside_recall", "all effects outside the library flagged"),
    Goal("confident_wrong_outside", "confident wrong names outside the library", high=0.10),
    Goal("pairs_top1", "pairs, both named"),
    Goal("pairs_one_named", "pairs, at least one named"),
)


def goals_result(result: Mapping[str, Any]) -> dict[str, Any]:
    """Every goal that has bounds: in words, and whether it is met."""
    return {g.key: {"goal": g.told, "met": g.met(result)} for g in GOALS if g.told != "none"}


def verdict_of(goal: Goal, result: Mapping[str, Any]) -> str:
    """The goal in words, and "hit" or "miss" where it can be judged."""
    met = goal.met(result)
    return f"goal {goal.told}" + ("" if met is None else ": hit" if met else ": miss")
