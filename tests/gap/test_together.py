"""Several tests: the median, what is carried from one to another, and what must not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.gap.diagnosis import diagnose
from pipeline.gap.effects import effect, library
from pipeline.gap.identifiability import Card
from pipeline.gap.together import pooled_card, scored_together, together
from pipeline.gap.transfer import OTHER, REPLICATE, Test
from tests.gap.scene import ABSCISSAE, START, entry, measured, simulate

FEW = (0.8, 1.0, 1.2)
SOME = ["cmod_gain", "fixture_compliance_um_per_kn", "modulus"]
GIVES = "fixture_compliance_um_per_kn"


def diagnosed(name: str, amplitude: float, seed: int, effect_name: str = GIVES, condition="seb", truth=(1.03, 0.95)):
    """A test of the hinge with an effect in it; an area of half a square metre where it is of another kind."""
    put_in = ([effect_name], [amplitude]) if amplitude else ((), ())
    seen = measured(*put_in, np.random.default_rng(seed), truth=truth)
    found = diagnose(seen, ABSCISSAE, simulate, START, entry(), np.random.default_rng(0), SOME, FEW)
    return Test(name, found, 1.0, (condition, 1e-5, None), simulate)


@pytest.fixture(scope="module")
def giving() -> list[Test]:
    return [diagnosed(f"t{k}", 20.0, k) for k in range(3)]


def test_replicates_agree_and_predict_each_other(giving):
    found = together(giving, np.random.default_rng(0))
    assert (found.verdict.kind, found.verdict.named) == ("cause", (GIVES,))
    rows = [t for t in found.transfers if t.label == GIVES]
    assert [(t.target, t.kind, t.carried, t.refitted) for t in rows] == [
        (f"t{k}", REPLICATE, (GIVES,), ()) for k in range(3)
    ]
    for row in rows:
        assert row.closure.fraction > 0.8
        assert row.closure.channels["field"].fraction > 0.8


def test_the_order_of_tests_does_not_matter(giving):
    one, two = (together(tests, np.random.default_rng(0)) for tests in (giving, giving[::-1]))
    assert one.verdict == two.verdict
    for label, p in one.scored.probability.items():
        assert two.scored.probability[label] == pytest.approx(p, rel=1e-9)
    assert np.array_equal(one.card.limit, two.card.limit)


def test_one_odd_specimen_does_not_raise_an_alarm():
    tests = [diagnosed("odd", 20.0, 0), diagnosed("b", 0.0, 11), diagnosed("c", 0.0, 12)]
    assert tests[0].diagnosis.verdict.kind == "cause"
    found = together(tests, np.random.default_rng(0))
    assert found.verdict.kind == "none needed"
    assert found.scored.log_bayes[GIVES] == pytest.approx(
        np.median([t.diagnosis.scored.log_bayes[GIVES] for t in tests])
    )


def told(test: Test, **log_bayes: float) -> Test:
    """The same test as if it had said this."""
    d = test.diagnosis
    return replace(test, diagnosis=replace(d, scored=replace(d.scored, log_bayes={**d.scored.log_bayes, **log_bayes})))


def test_explanations_that_beat_none_by_far_are_held_against_each_other(giving):
    """Each test prefers the gauge to the modulus a little; against none both are far ahead, differently far."""
    said = [{"cmod_gain": 105.0, "modulus": 104.0}, {"cmod_gain": 305.0, "modulus": 302.0}]
    tests = [told(t, **x) for t, x in zip(giving, [*said, {"cmod_gain": 250.0, "modulus": 245.0}], strict=True)]
    found = scored_together(tests, ["none", "cmod_gain", "modulus"], 2).log_bayes
    assert found["cmod_gain"] == pytest.approx(250.0)
    assert found["cmod_gain"] - found["modulus"] == pytest.approx(3.0)  # of 1, 3 and 5; medians of each differ by 5


def test_what_belongs_to_one_set_up_is_not_carried_to_another():
    tests = [diagnosed("a", 20.0, 0), diagnosed("b", 35.0, 1, condition="dct")]
    found = together(tests, np.random.default_rng(0))
    rows = [t for t in found.transfers if t.label == GIVES]
    assert {t.kind for t in rows} == {OTHER}
    for row in rows:  # each has its own size, with the parameters of the other
        assert (row.carried, row.refitted) == ((), (GIVES,))
        assert row.closure.fraction > 0.8


def test_parameters_are_carried_as_tractions_and_simulated_where_the_grid_ends():
    """The second test's bonds are twice as large: its f_max of 2.06 is the first one's 1.03, outside its grid."""
    asked = []

    def doubled(runs):
        asked.extend(runs)
        return simulate([type(run)(run.f_max / 2, run.delta_max, run.effects) for run in runs])

    one = diagnosed("a", 0.2, 0, "modulus")
    seen = measured(["modulus"], [0.2], np.random.default_rng(1))
    other = diagnose(seen, ABSCISSAE, doubled, (2.0, 1.0), entry(), np.random.default_rng(0), SOME, FEW)
    two = Test("b", other, 2.0, ("dct", 1e-5, None), doubled)
    assert not asked.clear()
    rows = [t for t in together([one, two], np.random.default_rng(0)).transfers if t.label == "modulus"]
    assert all(row.carried == ("modulus",) for row in rows)
    assert not asked  # f_max of one, doubled, lies in the grid of the other
    for row in rows:
        assert row.closure.whole.after < 1.3 * row.closure.whole.floor + 0.5
    far = Test("b", other, 1.0, ("dct", 1e-5, None), doubled)  # as if its bonds were as large: f_max of 1 lies outside
    together([one, far], np.random.default_rng(0))
    assert asked
    assert max(run.f_max for run in asked) < 1.3


def test_a_median_card_has_the_median_limit_and_needs_most_tests_to_see():
    def card(limit: float) -> Card:
        return Card(("a", "b"), np.array([limit, 1.0]), np.ones(2), np.ones(2), np.full((2, 2), 9.0), ())

    found = pooled_card([card(1.0), card(2.0), card(np.inf)], ["a", "b"])
    assert found.limit.tolist() == [2.0, 1.0]
    assert pooled_card([card(1.0), card(np.inf), card(np.inf)], ["a", "b"]).hidden == ("a",)


def test_every_effect_says_to_what_it_belongs():
    assert {effect(n).belongs for n in library()} == {"material", "set-up", "test"}


def test_strength_that_rises_with_the_rate_is_taken_to_the_rate_of_the_other_test():
    """0.2 a decade, after two components of a drift that have no part in it."""
    source = diagnosed("a", 0.0, 0)
    names = ("drift_um_per_min", "rate_law_per_decade")
    candidate = replace(
        source.diagnosis.best.candidate, names=names, magnitudes=tuple(effect(n).magnitude for n in names)
    )
    found = replace(source.diagnosis.best, candidate=candidate, amplitudes=np.array([5.0, -3.0, 0.2]))
    slower = replace(source, area=2.0, condition=("seb", 1e-6, None))
    assert slower.strength_ratio(source, found) == pytest.approx(2 * 0.8)
    assert source.strength_ratio(slower, found) == pytest.approx(0.5 * 1.2)
    assert replace(slower, condition=("seb", None, None)).strength_ratio(source, found) == 2.0  # a rate nobody knows
