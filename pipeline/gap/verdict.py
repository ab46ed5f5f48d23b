"""The verdict, from probabilities, classes and the gate; nothing here knows an effect by its name."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.gap.fit import Fitted
from pipeline.gap.gate import Gate
from pipeline.gap.identifiability import Card
from pipeline.gap.score import NONE, UNLISTED, Scored, names_of

SURE = 0.8  # probability from which a cause or a class is named
HALF = 0.5  # probability of none from which no cause is looked for

NONE_NEEDED, CAUSE, CLASS, ONE_OF, OUTSIDE = "none needed", "cause", "class", "one of", UNLISTED


@dataclass(frozen=True)
class Verdict:
    """What is said.

    Parameters
    ----------
    kind : one of the five
    named : tuple of effects
    reason : one sentence
    """

    kind: str
    named: tuple[str, ...]
    reason: str


def verdict(scored: Scored, card: Card, gate: Gate) -> Verdict:
    """Say what the data allow to be said."""
    blind = len(card.names) > 0 and len(card.hidden) == len(card.names)
    if not gate.passed:
        worst = gate.failed[0]
        excess = gate.ratio[worst] / gate.limit[worst]
        return Verdict(
            OUTSIDE,
            (),
            f"no effect of the library explains these data: {worst} stays {excess:.2g} times above what complete "
            "models leave; or the simulation itself fails",
        )
    if scored.probability[NONE] >= HALF:
        told = f"the model as it is has probability {scored.probability[NONE]:.2f}"
        return Verdict(
            NONE_NEEDED, (), f"{told}, but these data show no effect of any plausible size" if blind else told
        )
    strange = scored.probability.get(UNLISTED, 0.0)
    known = sum(p for label, p in scored.probability.items() if names_of(label))
    if strange > known:
        return Verdict(
            OUTSIDE,
            (),
            f"an effect that the library lacks has probability {strange:.2f}, all that it has {known:.2f} together, no "
            f"effect {scored.probability[NONE]:.2f}",
        )
    top = scored.causes()[0]
    names = names_of(top)
    mates = tuple(dict.fromkeys(m for n in names for m in card.class_of(n)))
    alone = len(mates) == len(names)
    if scored.probability[top] >= SURE and alone:
        return Verdict(CAUSE, names, f"{top} has probability {scored.probability[top]:.2f}")
    together = sum(p for label, p in scored.probability.items() if label in mates)
    if len(names) == 1 and not alone and together >= SURE:
        return Verdict(CLASS, mates, f"one of these has probability {together:.2f}; these data do not tell them apart")
    named = tuple(dict.fromkeys(n for label in scored.credible() for n in names_of(label)))
    told = f"no single one reaches {SURE}; these hold 90 % of the probability"
    if UNLISTED in scored.credible():
        told += f", with {strange:.2f} for an effect that the library lacks"
    sure = [n for n in named if scored.part(n) >= SURE]
    told += "".join(f"; {n} takes part, alone or with others, with {scored.part(n):.2f}" for n in sure)
    return Verdict(ONE_OF, named, told)


def on_the_edge(best: Fitted) -> Verdict:
    """What is said where the grid has followed the best explanation and still does not reach it."""
    f_max, delta_max = best.parameters
    return Verdict(
        OUTSIDE,
        (),
        f"the best explanation, {best.candidate.label}, lies on the edge of the grid at f_max = {f_max:.4g} N, "
        f"delta_max = {delta_max:.4g} m: no effect of the library explains these data; or check units, or move [start] "
        "there",
    )
