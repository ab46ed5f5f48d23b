"""Effects that specimens seem to have though they lack nothing: which bonds a crack meets is chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

WORTH = 4.0  # of log likelihood, for one more effect: log √24 for specimens (Schwarz 1978) and log 13 for the choice


@dataclass(frozen=True, eq=False)
class Seeming:
    """What is left of a specimen that lacks nothing, and what effects would change.

    Parameters
    ----------
    left : (n,) array; independent, of standard deviation one, and beside the parameters
    effects : physics effect → (n,) array, for a value of one
    """

    left: np.ndarray
    effects: Mapping[str, np.ndarray]


def apparent(specimens: Sequence[Seeming], least: Mapping[str, float] | None = None) -> dict[str, float]:
    """Standard deviations of effects that make what specimens leave most likely; effects that do not help are left out.

    One after the other the effect that raises the likelihood most, by `WORTH` at least, all standard deviations anew
    each time: effects that imitate each other do not count twice.

    Parameters
    ----------
    specimens : Seeming of each; effects that could not be simulated may lack
    least : effect → standard deviation that it has in any case
    """
    least = least or {}
    names = sorted({name for one in specimens for name in one.effects})
    chosen: dict[str, float] = {}
    best = _likelihood(specimens, least)
    while rest := [name for name in names if name not in chosen]:
        found, likelihood = max(
            (_likeliest(specimens, [*chosen, name], least) for name in rest), key=lambda one: one[1]
        )
        if likelihood < best + WORTH:
            break
        chosen, best = found, likelihood
    return {**least, **chosen}


def _likeliest(
    specimens: Sequence[Seeming], names: list[str], least: Mapping[str, float]
) -> tuple[dict[str, float], float]:
    """The likeliest standard deviations of some effects, and the logarithm of their likelihood against none."""
    squares = {n: [one.effects[n] @ one.effects[n] for one in specimens if n in one.effects] for n in names}
    unit = np.array([1 / np.sqrt(np.mean(squares[n]) + 1e-300) for n in names])

    def scatter(log: np.ndarray) -> dict[str, float]:
        found = zip(names, (unit * np.exp(np.clip(log, -20, 20))).tolist(), strict=True)
        return {name: float(np.hypot(value, least.get(name, 0.0))) for name, value in found}

    found = minimize(
        lambda log: -_likelihood(specimens, {**least, **scatter(log)}), np.ones(len(names)), method="Nelder-Mead"
    )
    return scatter(found.x), -float(found.fun)


def _likelihood(specimens: Sequence[Seeming], scatter: Mapping[str, float]) -> float:
    """Log density of what specimens leave, against no effects at all (Woodbury 1950)."""
    total = 0.0
    for one in specimens:
        columns = [value * one.effects[name] for name, value in scatter.items() if name in one.effects]
        if not columns:
            continue
        seen = np.column_stack(columns)
        inner, along = np.eye(len(columns)) + seen.T @ seen, seen.T @ one.left
        total += 0.5 * float(along @ np.linalg.solve(inner, along) - np.linalg.slogdet(inner)[1])
    return total
