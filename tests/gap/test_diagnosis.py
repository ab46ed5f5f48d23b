"""Whole diagnoses of a made-up hinge, whose discrepancy is exactly the one it is judged by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError
from pipeline.gap.diagnosis import diagnose
from pipeline.gap.effects import library
from pipeline.gap.observation import Observation, Reading
from tests.gap.scene import ABSCISSAE, PHYSICS, START, entry, measured, simulate

FEW = (0.8, 1.0, 1.2)
SOME = ["cmod_gain", "fixture_compliance_um_per_kn", "load_gain", "modulus", "sync_offset_s"]


def found(observation: Observation, names=SOME, simulator=simulate):
    return diagnose(observation, ABSCISSAE, simulator, START, entry(), np.random.default_rng(0), names, FEW)


def test_a_fixture_that_gives_way_is_named_and_measured():
    d = found(measured(["fixture_compliance_um_per_kn"], [20.0], np.random.default_rng(1)))
    assert (d.verdict.kind, d.verdict.named) == ("cause", ("fixture_compliance_um_per_kn",))
    low, high = d.fits["fixture_compliance_um_per_kn"].interval()[0]
    assert low < 20 < high
    assert d.closures["fixture_compliance_um_per_kn"].fraction > 0.8
    assert d.card.limit[d.card.names.index("fixture_compliance_um_per_kn")] < 20
    assert d.runs == 9 + 1 + 2  # the grid, the fit itself, the modulus at two values


def test_a_test_that_lacks_nothing_needs_nothing():
    d = found(measured(rng=np.random.default_rng(2)))
    assert d.verdict.kind == "none needed"
    assert d.gate.passed
    assert sum(d.scored.probability.values()) == pytest.approx(1.0)


def test_the_order_of_points_and_effects_does_not_matter():
    test = measured(["cmod_gain"], [0.06], np.random.default_rng(3))
    order = np.random.default_rng(4).permutation(len(test.sight.points))
    sight = replace(test.sight, points=test.sight.points[order], side=test.sight.side[order])
    reading = Reading(test.reading.field[:, order], test.reading.load)
    turned = Observation(sight, reading, test.field_std[:, order], test.load_std)

    def shuffled(runs):
        return [o if isinstance(o, str) else replace(o, field=o.field[:, order]) for o in simulate(runs)]

    one, two = found(test), found(turned, SOME[::-1], shuffled)
    assert one.verdict.kind == two.verdict.kind
    assert one.verdict.named == two.verdict.named
    for label, p in one.scored.probability.items():
        assert two.scored.probability[label] == pytest.approx(p, abs=1e-4)  # steps end at another round-off


def test_what_cannot_be_simulated_is_said_not_left_out():
    d = found(measured(rng=np.random.default_rng(5)), ["creep", "modulus"])
    assert d.untested == {"creep": "the hinge knows no creep"}
    assert "creep" not in d.scored.probability


def test_a_baseline_that_cannot_be_simulated_is_no_verdict():
    with pytest.raises(ConvergenceError, match="baseline"):
        found(measured(), simulator=lambda runs: ["no equilibrium"] * len(runs))


@pytest.mark.parametrize("lacking", ["field", "load"])
def test_it_works_with_one_channel(lacking):
    test = measured(["cmod_gain"], [0.06], np.random.default_rng(6))
    reading = test.reading
    if lacking == "field":
        reading = Reading(np.full_like(reading.field, np.nan), reading.load)
    else:
        reading = Reading(reading.field, np.full_like(reading.load, np.nan))
    d = found(replace(test, reading=reading))
    assert {c.channel for c in d.cells} == ({"load"} if lacking == "field" else {"field"})
    blind = "fixture_compliance_um_per_kn" if lacking == "field" else "load_gain"
    assert blind in d.card.hidden


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [("cmod_gain", 0.08), ("sync_offset_s", 2.0), ("magnification", 0.002), ("drift_um_per_min", (12.0, 9.0))],
)
def test_effects_of_the_measurement_are_named_among_all(name, value):
    d = found(measured([name], [value], np.random.default_rng(7)), list(library()))
    assert (d.verdict.kind, d.verdict.named) == ("cause", (name,))
    assert set(d.untested) == {n for n, e in library().items() if e.kind == "physics"} - set(PHYSICS)


@pytest.mark.slow
def test_an_effect_outside_the_library_is_not_pinned_on_another():
    names = [n for n in library() if n != "magnification"]
    d = found(measured(["magnification"], [0.003], np.random.default_rng(8)), names)
    assert d.verdict.kind != "none needed"
    assert d.verdict.kind != "cause" or d.verdict.named == ("lens_distortion",)
