"""Scores, classes, verdicts: closed forms, calibration on made-up data, and what must not matter."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from pipeline.gap.candidate import Candidate
from pipeline.gap.effect import Magnitude
from pipeline.gap.fit import Data, fit
from pipeline.gap.gate import Gate
from pipeline.gap.identifiability import DETECTED, Card, card
from pipeline.gap.metric import Metric
from pipeline.gap.score import NONE, UNLISTED, from_bayes, inclusion, pooled, score
from pipeline.gap.verdict import CAUSE, CLASS, NONE_NEEDED, ONE_OF, OUTSIDE, verdict
from tests.gap.linear import BOX, candidate, none

OPEN = Gate({"opening": 1.0}, {"opening": 2.0})
SHUT = Gate({"opening": 9.0, "load": 3.0}, {"opening": 2.0, "load": 2.0})
SIZE = Magnitude(-6.0, 6.0, 2.0, "1")


def names(n: int) -> list[str]:
    return [f"effect {i}" for i in range(n)]


def library(n: int = 5, size: int = 30, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(size, 2)), rng.normal(size=(size, n)) * 0.7


def judged(target: np.ndarray, base: np.ndarray, columns: np.ndarray):
    data = Data(target, Metric(np.eye(target.size)), BOX)
    evidence = {NONE: fit(none(base), data).log_evidence}
    for name, column in zip(names(columns.shape[1]), columns.T, strict=True):
        evidence[name] = fit(candidate(base, name, column, SIZE), data).log_evidence
    return score(evidence, columns.shape[1])


def test_none_has_half_the_prior_and_a_pair_the_product_of_odds():
    for n in (1, 5, 20):
        assert (1 + inclusion(n)) ** -n == pytest.approx(0.5)
    odds = inclusion(2)
    with_unlisted = from_bayes({NONE: 0.0, "a": 0.0, UNLISTED: 0.0}, 1)
    assert with_unlisted.probability["a"] == pytest.approx(with_unlisted.probability[UNLISTED])
    assert with_unlisted.probability[NONE] == pytest.approx(0.5 / (0.5 + 2 * 0.5 * inclusion(2)))  # no pair scored
    flat = from_bayes({NONE: 0.0, "a": 0.0, "b": 0.0, "a + b": 0.0}, 2)
    assert flat.probability[NONE] == pytest.approx(0.5)
    assert flat.probability["a + b"] == pytest.approx(odds**2 * 0.5)


def test_temper_pulls_probabilities_towards_the_prior():
    cold = from_bayes({NONE: 0.0, "a": 5.0}, 20)
    warm = from_bayes({NONE: 0.0, "a": 5.0}, 20, temperature=5.0)
    assert warm.probability["a"] < cold.probability["a"]
    assert warm.log_bayes == cold.log_bayes


def test_replicates_are_pooled_by_the_median():
    found = pooled([{NONE: 0.0, "a": 1.0, "b": 9.0}, {NONE: 0.0, "a": 2.0}, {NONE: 0.0, "a": 30.0}])
    assert found == {NONE: 0.0, "a": 2.0}


@pytest.mark.slow
def test_probabilities_are_what_happens():
    """Effects drawn from the very prior: of those named with probability p a share p is right."""
    base, columns = library()
    rng = np.random.default_rng(1)
    stated, right = [], []
    for _ in range(150):
        true = NONE if rng.uniform() < 0.5 else names(5)[rng.integers(5)]
        target = base @ rng.uniform(-5, 5, 2) + rng.standard_normal(len(base))
        if true != NONE:
            value = np.inf
            while abs(value) > 6:
                value = 2.0 * rng.standard_normal()
            target = target + columns[:, names(5).index(true)] * value
        found = judged(target, base, columns)
        top = found.ranked()[0]
        stated.append(found.probability[top])
        right.append(top == true)
    assert np.mean(stated) > 0.6  # the data do say something
    # three standard deviations of 150 trials: 0.11; singles have a little more than half the prior, 0.03
    assert np.mean(right) == pytest.approx(np.mean(stated), abs=0.14)


def test_d_prime_is_the_closed_form_and_falls_with_noise():
    base, columns = library()
    before = np.inf
    for noise in (1.0, 1.5, 3.0, 10.0):
        data = Data(np.zeros(len(base)), Metric(noise**2 * np.eye(len(base))), BOX)
        found = card(
            {n: candidate(base, n, c, SIZE) for n, c in zip(names(5), columns.T, strict=True)}, data, np.zeros(2)
        )
        left = columns - base @ np.linalg.lstsq(base, columns, rcond=None)[0]
        exact = 6.0 * np.linalg.norm(left, axis=0) / noise
        assert np.allclose(found.d_prime, exact, rtol=1e-6)
        seen = np.isfinite(found.limit)
        assert np.allclose(found.limit[seen], 6.0 * DETECTED / exact[seen], rtol=2e-3)  # bisection to 1e-3
        assert (found.d_prime < before).all()
        before = found.d_prime


def test_temper_raises_detection_limits():
    base, columns = library()
    data = Data(np.zeros(len(base)), Metric(np.eye(len(base))), BOX)
    some = {"a": candidate(base, "a", columns[:, 0], SIZE)}
    cold, warm = (card(some, data, np.zeros(2), temperature=t) for t in (1.0, 4.0))
    assert warm.d_prime[0] == pytest.approx(cold.d_prime[0] / 2)


def test_two_effects_that_do_the_same_are_a_class_and_others_are_not():
    base, columns = library()
    data = Data(np.zeros(len(base)), Metric(np.eye(len(base))), BOX)
    twice = {
        "a": candidate(base, "a", columns[:, 0], SIZE),
        "b": candidate(base, "b", 1.01 * columns[:, 0] + base[:, 0], SIZE),  # the same but for a change of λ
        "c": candidate(base, "c", columns[:, 1], SIZE),
    }
    assert card(twice, data, np.zeros(2)).classes == (("a", "b"),)


def test_what_is_doubted_in_a_competitor_is_no_difference():
    """b is known to a tenth of its norm along c: a, which is b with that in it, is told from b by no more than that."""
    base, columns = library()
    data = Data(np.zeros(len(base)), Metric(np.eye(len(base))), BOX)
    one, other = columns[:, 0], columns[:, 1]
    b = replace(candidate(base, "b", 2 * one, SIZE), doubt=lambda a: np.outer(other, a))
    some = {"a": candidate(base, "a", 2 * one + other, SIZE), "b": b}
    found = card(some, data, np.zeros(2))
    assert found.remaining.max() < 1.1  # one standard deviation
    assert found.classes == (("a", "b"),)
    sure = card({**some, "b": candidate(base, "b", 2 * one, SIZE)}, data, np.zeros(2))
    assert sure.classes == ()


def test_an_effect_that_would_have_to_be_implausible_is_no_mate():
    base, columns = library()
    data = Data(np.zeros(len(base)), Metric(np.eye(len(base))), BOX)
    some = {
        "a": candidate(base, "a", columns[:, 0], SIZE),
        "b": candidate(base, "b", columns[:, 0], Magnitude(-1.0, 1.0, 0.5, "1")),  # cannot grow as large
    }
    found = card(some, data, np.zeros(2))
    assert found.remaining[0, 1] > 2
    assert found.classes == ()


def test_an_unknown_direction_counts_by_the_least_visible_one():
    base, columns = library()
    data = Data(np.zeros(len(base)), Metric(np.eye(len(base))), BOX)
    plane = Candidate(
        ("a",), (Magnitude(0.0, 6.0, 2.0, "1", directions=2),), lambda x, a: base @ x + columns[:, :2] @ a
    )
    found = card({"a": plane}, data, np.zeros(2))
    left = columns[:, :2] - base @ np.linalg.lstsq(base, columns[:, :2], rcond=None)[0]
    assert found.d_prime[0] == pytest.approx(6.0 * np.linalg.svd(left)[1][-1], rel=1e-6)


def cards(classes=()) -> Card:
    n = len(names(3))
    return Card(tuple(names(3)), np.ones(n), np.full(n, 9.0), np.ones(n), np.zeros((n, n)), classes)


@pytest.mark.parametrize(
    ("bayes", "classes", "gate", "kind", "named"),
    [
        ((0.0, 0.0, 0.0), (), OPEN, NONE_NEEDED, ()),
        ((9.0, 0.0, 0.0), (), OPEN, CAUSE, ("effect 0",)),
        ((9.0, 8.5, 0.0), (("effect 0", "effect 1"),), OPEN, CLASS, ("effect 0", "effect 1")),
        ((9.0, 0.0, 0.0), (("effect 0", "effect 1"),), OPEN, CLASS, ("effect 0", "effect 1")),
        ((9.0, 8.9, 0.0), (), OPEN, ONE_OF, ("effect 0", "effect 1")),
        ((90.0, 0.0, 0.0), (), SHUT, OUTSIDE, ()),
        ((0.0, 0.0, 0.0), (), SHUT, OUTSIDE, ()),
    ],
)
def test_verdicts(bayes, classes, gate, kind, named):
    log_bayes = {NONE: 0.0, **dict(zip(names(3), bayes, strict=True))}
    found = verdict(from_bayes(log_bayes, 3), cards(classes), gate)
    assert (found.kind, set(found.named)) == (kind, set(named))


def test_what_the_library_lacks_is_weighed_like_an_effect_and_is_a_verdict():
    for strange, kind in ((0.5, NONE_NEEDED), (30.0, OUTSIDE), (20.5, ONE_OF)):
        scored = from_bayes({NONE: 0.0, UNLISTED: strange, "effect 0": 0.0 if strange < 20 else 21.0}, 3)
        assert scored.probability[UNLISTED] / scored.probability[NONE] == pytest.approx(np.exp(strange) * inclusion(4))
        found = verdict(scored, cards(), OPEN)
        assert found.kind == kind, strange
    assert found.named == ("effect 0",)
    assert "an effect that the library lacks" in found.reason


def test_what_the_library_lacks_names_nothing_where_it_comes_before_all_causes():
    """None 0.47, outside 0.46, each of eighteen effects 0.004: to name two of these would be to name bystanders."""
    log_bayes = {NONE: 0.0, UNLISTED: 3.3, **dict.fromkeys(names(18), -1.5)}
    scored = from_bayes(log_bayes, 18)
    assert max(scored.probability.values()) < 0.5
    found = verdict(scored, cards(), OPEN)
    assert (found.kind, found.named) == (OUTSIDE, ())


def test_data_that_show_nothing_are_not_praised():
    flat = from_bayes({NONE: 0.0, **dict.fromkeys(names(3), 0.0)}, 3)
    n = len(names(3))
    blind = Card(tuple(names(3)), np.full(n, np.inf), np.full(n, 0.5), np.ones(n), np.zeros((n, n)), ())
    assert "show no effect" in verdict(flat, blind, OPEN).reason
    assert "show no effect" not in verdict(flat, cards(), OPEN).reason


def test_one_that_takes_part_in_all_explanations_is_said_to():
    log_bayes = {NONE: 0.0, "effect 0": 9.0, "effect 0 + effect 1": 10.5}
    scored = from_bayes(log_bayes, 3)
    assert max(scored.probability.values()) < 0.8 < scored.part("effect 0")
    found = verdict(scored, cards(), OPEN)
    assert found.kind == ONE_OF
    assert "effect 0 takes part" in found.reason
    assert "effect 1 takes part" not in found.reason


def test_the_verdict_does_not_hang_on_names():
    """The same data under permuted names: the same probabilities, permuted."""
    base, columns = library()
    target = base @ [1.0, 2.0] + 2.0 * columns[:, 3] + np.random.default_rng(5).standard_normal(len(base))
    straight = judged(target, base, columns)
    order = [2, 3, 4, 0, 1]
    turned = judged(target, base, columns[:, order])
    for place, was in enumerate(order):
        a, b = straight.probability[f"effect {was}"], turned.probability[f"effect {place}"]
        assert a == pytest.approx(b, rel=1e-9)


def test_effect_free_data_seldom_raise_an_alarm():
    base, columns = library()
    rng = np.random.default_rng(2)
    kinds = Counter()
    for _ in range(40):
        found = judged(base @ [1.0, 1.0] + rng.standard_normal(len(base)), base, columns)
        top = found.ranked()[0]
        kinds[top != NONE and found.probability[top] >= 0.8] += 1
    assert kinds[True] <= 3  # 0.02 expected of a calibrated judge: one run in a hundred thousand has four of forty
