"""Strength that depends on the rate of opening: closed forms, the sign, proportion, and nothing where there is none."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError
from pipeline.core.problem import Gauge
from pipeline.core.units import MM
from pipeline.equilibrium.solve import solve
from pipeline.gap.effects import effect
from pipeline.gap.plan import Plan
from pipeline.materials.cohesive import LinearSoftening
from pipeline.materials.elastic import Plane
from pipeline.materials.mixture import Mixture
from pipeline.materials.rate_softening import LEAST, RateSoftening
from pipeline.store.problem_key import problem_key
from pipeline.study.opening_rate import decades_of, openings, solve_at_rates
from pipeline.twin.problem import Truth, one_phase
from pipeline.twin.virtual_test import Recording, virtual_test
from tests.equilibrium.specimens import BEAM, chain, fracture_test

BOND = LinearSoftening(np.array([1e7]), np.array([50.0]), np.array([1e-4]))


def bond_seen_from_afar(lever: float):
    """One bond in series with a spring; the gauge shows `lever` times its opening, as a mouth does."""
    problem = chain(1e8, BOND, 0.9e-4 * lever)
    return replace(problem, gauge=Gauge(problem.gauge.index, lever * problem.gauge.weight))


def rated(problem, value: float):
    return problem.with_law(RateSoftening(problem.law, value))


@pytest.mark.parametrize("lever", [1.0, 2.0, 10.0])
def test_a_bond_that_opens_at_a_share_of_the_mouths_rate_is_as_strong_as_the_formula_says(lever):
    problem = bond_seen_from_afar(lever)
    found = solve_at_rates(rated(problem, 0.2), solve)
    factor = 1 - 0.2 * np.log10(lever)
    assert found.curve.load.max() == pytest.approx(50 * factor, rel=5e-3)  # an increment may step over the peak
    at = np.array([0.5, 0.8]) * 1e-4
    exact = BOND.times(1.0, factor, 1.0).force(at, at)
    assert found.curve.load_at(lever * at) == pytest.approx(
        exact, rel=5e-4
    )  # the gauge is met to a share of its travel
    assert "after simulation 2" in found.message  # the rate is the lever's whatever the strength


def test_the_rate_is_read_of_the_softening_only_and_is_the_levers():
    problem = replace(bond_seen_from_afar(4.0), stations=np.linspace(0, 3.6e-4, 41)[1:])
    found = solve(problem)
    assert decades_of(problem, found) == pytest.approx(-np.log10(4.0), abs=1e-6)  # of both bonds: the spring's is near
    assert openings(problem, found.displacement)[:, 0] == pytest.approx(found.cmod / 4, rel=1e-9)


def test_strength_never_vanishes():
    law = RateSoftening(BOND, 0.3).at(np.array([-20.0]))
    assert law.f_max == pytest.approx(LEAST * 50)
    assert law.k_n == BOND.k_n
    assert law.delta_max == BOND.delta_max


def test_other_laws_are_left_alone_and_a_value_makes_another_simulation():
    problem = bond_seen_from_afar(2.0)
    plain, same = solve(problem), solve_at_rates(problem, solve)
    assert np.array_equal(same.curve.load, plain.curve.load)
    keys = {problem_key(p, "engine") for p in (problem, rated(problem, 0.1), rated(problem, 0.2))}
    assert len(keys) == 3


def test_changes_of_bonds_reach_the_law_below():
    law = RateSoftening(BOND, 0.3).times(2.0, 0.5, 3.0).spared(np.array([False]))
    assert (law.k_n[0], law.f_max[0], law.delta_max[0]) == pytest.approx((2e7, 25.0, 3e-4))
    assert np.isinf(law.spared(np.array([True])).f_max[0])


@pytest.fixture(scope="module")
def beams():
    """A coarse beam without the effect, with it, and with twice of it."""
    problem = fracture_test(radius=2 * MM)
    return problem, [solve_at_rates(rated(problem, v), solve) for v in (1e-9, 0.1, 0.2)]


def test_a_beams_bonds_open_slower_than_its_mouth_and_the_slower_the_higher_up(beams):
    problem, (plain, *_) = beams
    looks = replace(problem, stations=np.linspace(0, problem.cmod_max, 41)[1:])
    decades = decades_of(looks, solve(looks))
    height = problem.particles.position[problem.bonds.pairs].mean(axis=1)[:, 1]
    cracked = plain.reached > problem.law.delta_peak
    assert (decades < 0).all()
    low, high = (decades[cracked & (np.abs(height - y) < 5 * MM)].mean() for y in (20 * MM, 40 * MM))
    # halves that turn about a point below the back, 55 mm from the mouth, open there by 1 − y/55, a bond by half to all
    assert np.log10(1 - 20 / 55) - 0.35 < low < np.log10(1 - 20 / 55) + 0.05
    assert high < low - 0.15


def test_the_effect_lowers_the_load_and_twice_of_it_twice_as_much(beams):
    problem, found = beams
    none, once, twice = (f.curve for f in found)
    for reading in (lambda c: c.load.max(), lambda c: c.load_at(np.array([0.2 * MM]))[0]):
        first, second = (1 - reading(c) / reading(none) for c in (once, twice))
        assert 0.01 < first < 0.1  # at most a decade
        assert second / first == pytest.approx(2, rel=0.25)  # strengths in proportion, their specimen not quite
    assert np.array_equal(found[1].cmod, problem.stations)  # and no other frames


def test_an_irregular_network_loses_as_much_as_the_lattice(beams):
    """Two discretisations of one beam, the same law: peak and tail fall alike within what the networks differ by."""
    _, (none, _, twice) = beams
    at = np.array([0.2 * MM])
    lattice = [
        1 - read(twice.curve) / read(none.curve) for read in (lambda c: c.load.max(), lambda c: c.load_at(at)[0])
    ]
    mixture, truth = Mixture(10e9, 50e9, 0.25, Plane.STRAIN, 71.0, 1.14e-4), Truth(71.0 * 2 / 0.3, 1.14e-4, 2 * MM)
    curves = []
    for value in (0.0, 0.2):
        plan = effect("rate_law_per_decade").change(value, Plan(BEAM, mixture))
        test = virtual_test(
            BEAM, one_phase, mixture, truth, Recording(1e-5, 0.4 * MM), 4 * MM, np.random.default_rng(3),
            partial(solve_at_rates, solve=solve), plan=plan,
        )  # fmt: skip
        curves.append(test.solution.curve)
    peak, tail = 1 - curves[1].load.max() / curves[0].load.max(), 1 - (curves[1].load_at(at) / curves[0].load_at(at))[0]
    assert (peak, tail) == pytest.approx(lattice, abs=0.02)  # of 0.05 and 0.08; one network against one lattice


def test_what_does_not_come_to_rest_is_refused():
    """An engine whose mouth opens now at one rate, now at a tenth of it."""
    problem = bond_seen_from_afar(2.0)
    counted = iter(range(100))

    def restless(asked):
        found = solve(asked)
        return replace(found, cmod=found.cmod * (10 if next(counted) % 2 else 1))

    with pytest.raises(ConvergenceError, match="do not agree after"):
        solve_at_rates(rated(problem, 0.3), restless)
