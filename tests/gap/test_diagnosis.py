"""Whole diagnoses of a made-up hinge, whose discrepancy is exactly the one it is judged by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError
from pipeline.gap.diagnosis import baseline, diagnose, with_placements
from pipeline.gap.effects import library
from pipeline.gap.identifiability import card
from pipeline.gap.observation import Observation, Reading
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
    calm, wild = (found(test, ["load_gain"], simulator).emulator for simulator in (simulate, jumping))
    mask = test.mask
    still, moved = (np.sqrt(np.diag(scatter(e, mask))[-13:]) for e in (calm, wild))
    # effects are simulated at a node, which does not jump: two of three nudges differ by 40 N from it, and the grid
    assert moved == pytest.approx(40 * np.sqrt(2 / 3), rel=0.01)
    assert (still < 20).all()


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


def test_what_other_places_of_the_lattice_change_widens_the_metric():
    """A load that is 60 N higher on every other place of the lattice counts with the weight that the entry gives it."""

    def placed(runs):
        moved = [60.0 * (run.placement != (0.0, 0.0)) for run in runs]
        return [replace(o, load=o.load + m) for m, o in zip(moved, simulate(runs), strict=True)]

    test, plain_entry = measured(rng=np.random.default_rng(2)), entry()
    start, grid = np.array(START), Design(START, FEW, FEW)
    emulator, _ = baseline(test, ABSCISSAE, placed, grid, plain_entry)
    emulator = with_placements(emulator, placed, start)
    counting = replace(plain_entry, discrepancy=replace(plain_entry.discrepancy, placements=0.5))
    before, after = (np.diag(weighed(test, emulator, e)[1].metric.covariance)[-13:] for e in (plain_entry, counting))
    assert np.allclose(after - before, 0.5 * 60.0**2)
