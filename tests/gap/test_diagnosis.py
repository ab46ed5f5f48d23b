"""Whole diagnoses of a made-up hinge, whose discrepancy is exactly the one it is judged by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError
from pipeline.gap.diagnosis import Run, baseline, diagnose, with_placements
from pipeline.gap.effects import library
from pipeline.gap.emulator import LARGE, Signature
from pipeline.gap.identifiability import card
from pipeline.gap.metric import doubted
from pipeline.gap.observation import Observation, Reading
from pipeline.gap.response import split
from pipeline.gap.weighing import scatter, weighed
from pipeline.inverse.design import Design
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
    assert d.runs == 9 + 2 + 3  # the grid, near whose middle the fit lies, the modulus at two values, nudges


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


def test_the_seed_moves_intervals_of_closure_and_nothing_else():
    test = measured(["cmod_gain"], [0.06], np.random.default_rng(3))
    one, two = (
        diagnose(test, ABSCISSAE, simulate, START, entry(), np.random.default_rng(seed), SOME[:2], FEW)
        for seed in (0, 1)
    )
    assert one.verdict == two.verdict
    assert one.scored == two.scored
    assert one.cells == two.cells
    a, b = (d.closures["cmod_gain"].whole for d in (one, two))
    assert (a.before, a.after) == (b.before, b.after)
    for x, y in ((a, b), (b, a)):
        assert y.interval[0] < x.fraction < y.interval[1]


def test_more_noise_never_shows_more():
    """d′ of every effect falls, and its detection limit rises, with the noise of the camera and of the load cell."""
    test = measured(rng=np.random.default_rng(2))
    emulator = found(test).emulator
    before = None
    for factor in (1.0, 1.5, 4.0, 20.0):
        loud = replace(test, field_std=factor * test.field_std, load_std=factor * test.load_std)
        seen, data = weighed(loud, emulator, entry())
        singles = {n: emulator.candidate([n], seen.mask) for n in SOME}
        now = card(singles, data, np.array([1.03, 0.95]))
        if before is not None:
            assert (now.d_prime < before.d_prime).all()
            assert (now.limit >= before.limit).all()
        before = now


def test_no_closure_is_told_the_load_that_it_is_judged_by():
    """A fixture gives way by the measured load when it is weighed, by the simulated one when loads are held out."""
    name = "fixture_compliance_um_per_kn"
    test = measured([name], [30.0], np.random.default_rng(1))
    test = replace(test, sight=replace(test.sight, load=test.reading.load))
    d, few = (
        found(test, [name, "modulus"]),
        found(measured([name], [30.0], np.random.default_rng(1)), [name, "modulus"]),
    )
    told, bare = (c.candidate([name], test.mask) for c in (d.emulator, d.emulator.unloaded()))
    at, value = np.array(START), np.array([30.0])
    assert not np.allclose(told.predict(at, value), bare.predict(at, value))
    assert d.scored.log_bayes[name] != few.scored.log_bayes[name]
    one, other = d.closures[name], few.closures[name]
    assert one.before.scaled == pytest.approx(other.before.scaled, rel=1e-6)
    # the same data, fitted from another start: iterations end where χ² falls by 1e-4
    assert one.after.scaled == pytest.approx(other.after.scaled, rel=1e-3)


def test_what_cannot_be_simulated_is_said_not_left_out():
    d = found(measured(rng=np.random.default_rng(5)), ["creep", "modulus"])
    assert d.untested == {"creep": "the hinge knows no creep"}
    assert "creep" not in d.scored.probability


def test_simulations_that_jump_widen_the_metric():
    """A load that jumps by ±40 N from run to run, beside the grid alone: the nudges see it."""

    def jumping(runs):
        jumps = [0.0 if run.f_max in (0.8, 1.0, 1.2) else 40.0 * (-1) ** k for k, run in enumerate(runs)]
        return [replace(o, load=o.load + j) for j, o in zip(jumps, simulate(runs), strict=True)]

    test = measured(rng=np.random.default_rng(2))
    calm, wild = (found(test, ["modulus"], simulator).emulator for simulator in (simulate, jumping))
    mask = test.mask
    still, moved = (np.sqrt(np.diag(scatter(e, mask))[-13:]) for e in (calm, wild))
    # effects are simulated at a node, which does not jump: two of three nudges differ by 40 N from it, and the grid
    assert moved == pytest.approx(40 * np.sqrt(2 / 3), rel=0.01)
    assert (still < 20).all()


def test_a_baseline_that_cannot_be_simulated_is_no_verdict():
    with pytest.raises(ConvergenceError, match="baseline"):
        found(measured(), simulator=lambda runs: ["no equilibrium"] * len(runs))


def test_an_explanation_that_the_grid_does_not_reach_is_no_cause():
    """[start] in other units: the grid follows as far as it may."""
    start, rng = (START[0] / 30, START[1]), np.random.default_rng(0)
    d = diagnose(measured(rng=np.random.default_rng(2)), ABSCISSAE, simulate, start, entry(), rng, ["cmod_gain"], FEW)
    assert (d.verdict.kind, d.verdict.named) == ("outside the library", ())
    assert "edge of the grid" in d.verdict.reason
    assert "units" in d.verdict.reason


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


def test_other_places_of_the_lattice_move_the_model_to_their_mean_and_widen_the_metric_by_its_error():
    """A load that is 60 N higher on the other three places: 45 N in the mean, which is known to 15 N."""

    def placed(runs):
        moved = [60.0 * (run.placement != (0.0, 0.0)) for run in runs]
        return [replace(o, load=o.load + m) for m, o in zip(moved, simulate(runs), strict=True)]

    test, plain_entry = measured(rng=np.random.default_rng(2)), entry()
    start, grid = np.array(START), Design(START, FEW, FEW)
    alone, _ = baseline(test, ABSCISSAE, placed, grid, plain_entry)
    emulator = with_placements(alone, placed, start)
    counting = replace(plain_entry, discrepancy=replace(plain_entry.discrepancy, placements=0.5))
    before, after = (np.diag(weighed(test, emulator, e)[1].metric.covariance)[-13:] for e in (plain_entry, counting))
    assert np.allclose(after - before, 0.5 * 15.0**2)
    for names, amplitudes in (((), np.zeros(0)), (("sync_offset_s",), np.zeros(1)), (("sync_offset_s",), np.ones(1))):
        mean, one = (e.reading(start, names, amplitudes) for e in (emulator, alone))
        np.testing.assert_allclose(mean.load - one.load, 45.0)
        np.testing.assert_allclose(mean.field, one.field)
    again = emulator.confirmed(start, simulate([Run(*START)])[0].flat())  # what one place says does not undo the mean
    np.testing.assert_allclose(again.reading(start).load - alone.reading(start).load, 45.0)


def test_a_fragment_that_comes_off_does_not_count_as_what_an_effect_does():
    """A point that flies 20 µm off in simulations with an effect: the effect is what the other points show."""
    whole = found(measured(rng=np.random.default_rng(2)), ["modulus"]).emulator
    signature, points = whole.signatures["modulus"], len(whole.sight.points)
    changes = []
    for row in signature.changes:
        one = split(row, ABSCISSAE, points)
        one.field[5:, 6, 0] -= 20e-6
        changes.append(one.flat())
    broken = replace(whole, signatures={"modulus": replace(signature, changes=np.array(changes))})
    clean, odd = (e.reading(np.array(START), ("modulus",), np.array([0.2])) for e in (whole, broken))
    assert np.abs(odd.field - clean.field).max() < 0.1e-6  # weights fall with the distance, but not to zero
    np.testing.assert_allclose(odd.load, clean.load)


def test_what_does_not_grow_in_proportion_to_an_effect_is_doubted():
    """A straight signature is believed; of one that is alike for both signs, as when a crack turns off, nothing."""
    values, line = np.array([-0.3, 0.6]), np.array([1.0, -2.0])
    straight = Signature(values, np.outer(values, line))
    assert np.allclose(straight.doubt(0.25), 0.0)
    assert np.allclose(straight.at(0.25), 0.25 * line)
    even = Signature(np.array([-0.3, 0.3]), np.array([line, line]))
    assert np.allclose(np.abs(even.doubt(0.3)), np.abs(line))
    assert np.allclose(even.doubt(0.15), even.doubt(0.3) / 2)  # in proportion: of a small one as little is known
    mixed = Signature(np.array([-0.3, 0.3]), np.array([0.0 * line, line]))
    assert np.allclose(np.abs(mixed.doubt(0.3)), np.abs(line) / 2)
    onward = Signature(np.array([0.35, 0.75]), np.array([line, line]))  # a crack that turns off at once
    assert all(np.abs(onward.doubt(value)).max() > 0.2 * value for value in np.linspace(0.05, 1.0, 20))  # never sure


def test_what_a_tiny_value_is_off_by_says_nothing_of_others():
    """A fit that ends at 1e-17 of an effect once made its signature 1e17 times what one simulation scatters."""
    steep = Signature(np.array([0.35, 0.75]), np.ones((2, 3)))
    assert [steep.large(v) for v in (0.0, 1e-17, 0.1, 0.16, -0.5, 1.0)] == [False, False, False, True, True, True]
    met = steep.corrected(0.16, np.full(3, 0.5))
    assert np.allclose(met.at(0.16), steep.at(0.16) + 0.5)  # meets the simulation
    assert np.abs(met.changes - steep.changes).max() <= 0.5 / LARGE  # and no value by more than that


def test_an_effect_is_seen_less_where_it_is_doubted():
    change, doubt = np.array([3.0, 4.0]), np.array([[0.0], [2.0]])
    assert np.allclose(doubted(change, doubt), (3.0, 4.0 / np.sqrt(5)))
    assert np.allclose(doubted(change, None), change)


def test_what_specimens_seem_to_have_widens_the_metric_by_its_signature():
    test, plain = measured(rng=np.random.default_rng(2)), entry()
    emulator = found(test, ["modulus"]).emulator
    seeming = replace(plain, apparent={"modulus": 0.1, "creep": 5.0})  # of what was not simulated nothing is known
    before, after = (weighed(test, emulator, e)[1].metric.covariance for e in (plain, seeming))
    slope = emulator.slopes(test.mask)["modulus"]
    np.testing.assert_allclose(after - before, 0.01 * np.outer(slope, slope), atol=1e-9 * np.abs(before).max())
    small = emulator.reading(np.array(START), ("modulus",), np.array([1e-3])) - emulator.reading(np.array(START))
    # the line through two values is the change by a small one, but for the curve between them
    assert np.linalg.norm(small.load - 1e-3 * slope[-13:]) < 0.3 * np.linalg.norm(small.load)
