"""Several tests together: what they say by the median, and whether what one teaches predicts another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.gap.fit import Fitted, fit
from pipeline.gap.gate import Gate
from pipeline.gap.identifiability import Card, classes
from pipeline.gap.score import NONE, UNLISTED, Scored, from_bayes, names_of, pairs, pooled
from pipeline.gap.transfer import Test, Transfer, transfers
from pipeline.gap.verdict import Verdict, verdict

TOLD = 3  # best explanations whose transfer is looked at


@dataclass(frozen=True, eq=False)
class Together:
    """What several tests say.

    Parameters
    ----------
    tests : tuple of Test, with the fits of all pairs that are pooled
    scored : Scored; of median log Bayes factors
    card : Card; medians, classes of these
    gate : Gate; medians
    verdict : Verdict
    transfers : list of Transfer
    untested : effect → why it could not be judged in every test
    """

    tests: tuple[Test, ...]
    scored: Scored
    card: Card
    gate: Gate
    verdict: Verdict
    transfers: list[Transfer]
    untested: Mapping[str, str]


def together(tests: Sequence[Test], rng: np.random.Generator) -> Together:
    """Pool tests that were diagnosed one by one.

    Log Bayes factors are pooled by their median: what simulators leave out in all specimens alike would count as often
    as there are specimens in a sum. So replicates make a verdict robust; they do not lower what can be seen.

    Parameters
    ----------
    tests : two or more
    rng : numpy Generator; of bootstrap and floor
    """
    names = sorted(set.intersection(*(set(t.diagnosis.card.names) for t in tests)))
    unnamed = [NONE, UNLISTED] if names else [NONE]
    singles = scored_together(tests, [*unnamed, *names], len(names))
    wanted = [*pairs(singles), *_pairs_of_all(tests)]
    tests = tuple(_with_pairs(t, wanted) for t in tests)
    labels = [*unnamed, *names, *dict.fromkeys(" + ".join(p) for p in wanted)]
    scored = scored_together(tests, labels, len(names))
    card, gate = pooled_card([t.diagnosis.card for t in tests], names), pooled_gate([t.diagnosis.gate for t in tests])
    best = scored.causes()[:TOLD]
    return Together(
        tests=tests,
        scored=scored,
        card=card,
        gate=gate,
        verdict=verdict(scored, card, gate),
        transfers=transfers(tests, best, rng),
        untested=_untested(tests, names),
    )


def scored_together(tests: Sequence[Test], labels: Sequence[str], effects: int) -> Scored:
    """Probabilities from the median log Bayes factors of labels that all tests have.

    Counted from the label that no other beats in the median: where none is hopeless, log Bayes factors against it
    differ by hundreds from test to test, and medians of two labels may come from two tests.
    """
    each = [t.diagnosis.scored.log_bayes for t in tests]
    rows = np.array([[one[label] for one in each] for label in labels])
    ahead = np.median(rows[:, None] - rows, axis=2).min(axis=1)
    best = rows[int(np.argmax(ahead))]
    found = pooled([dict(zip(labels, row, strict=True)) for row in (rows - best).T])
    temperature = max(t.diagnosis.scored.temperature for t in tests)
    return from_bayes({label: found[label] - found[NONE] for label in labels}, effects, temperature)


def _pairs_of_all(tests: Sequence[Test]) -> list[tuple[str, ...]]:
    """Pairs that every test came upon by itself."""
    own = [{names_of(label) for label in t.diagnosis.fits if len(names_of(label)) > 1} for t in tests]
    return sorted(set.intersection(*own))


def _with_pairs(test: Test, wanted: Sequence[tuple[str, ...]]) -> Test:
    """The same test, these pairs fitted too."""
    d = test.diagnosis
    fits, log_bayes = dict(d.fits), dict(d.scored.log_bayes)
    for pair in wanted:
        label = " + ".join(pair)
        if label not in fits:
            fits[label] = fit(d.emulator.candidate(pair, d.observation.mask), d.data)
            log_bayes[label] = fits[label].log_evidence - fits[NONE].log_evidence
    return replace(test, diagnosis=replace(d, fits=fits, scored=replace(d.scored, log_bayes=log_bayes)))


def pooled_card(cards: Sequence[Card], names: Sequence[str]) -> Card:
    """The median of several cards, of the effects that all have."""
    rows = [[c.names.index(n) for n in names] for c in cards]

    def median(values: Sequence[np.ndarray]) -> np.ndarray:
        return np.median(np.array([v[r] for v, r in zip(values, rows, strict=True)]), axis=0)

    limit = median([c.limit for c in cards])
    remaining = np.median([c.remaining[np.ix_(r, r)] for c, r in zip(cards, rows, strict=True)], axis=0)
    chosen = tuple(names)
    return Card(
        names=chosen,
        limit=limit,
        d_prime=median([c.d_prime for c in cards]),
        looked_at=median([c.looked_at for c in cards]),
        remaining=remaining,
        classes=classes(chosen, limit, remaining),
    )


def pooled_gate(gates: Sequence[Gate]) -> Gate:
    """The median of several gates, mode by mode."""
    modes = dict.fromkeys(m for g in gates for m in g.ratio)
    ratio = {m: float(np.median([g.ratio[m] for g in gates if m in g.ratio])) for m in modes}
    limit = {m: float(np.median([g.limit[m] for g in gates if m in g.limit])) for m in modes}
    return Gate(ratio, limit)


def _untested(tests: Sequence[Test], names: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for test in tests:
        for name, reason in test.diagnosis.untested.items():
            if name not in names:
                found.setdefault(name, f"{test.name}: {reason}")
    return found


def typical(fits: Sequence[Fitted], temperature: float) -> tuple[float, tuple[float, float]]:
    """Median of an effect's value over tests, and of the bounds of its 95 % interval in one test."""
    values = [float(f.values(temperature)[0]) for f in fits]
    bounds = np.median([f.interval(temperature=temperature)[0] for f in fits], axis=0)
    return float(np.median(values)), (float(bounds[0]), float(bounds[1]))
