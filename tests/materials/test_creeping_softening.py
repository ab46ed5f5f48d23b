"""The creeping bond: elastic limit, onset of softening in time, and what stays as without creep."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from pipeline.core.errors import InputError
from pipeline.materials.burgers import Burgers
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.creeping_softening import BondState, CreepingSoftening
from pipeline.materials.prony import PronySeries
from pipeline.materials.relaxation import arms
from pipeline.materials.softening import Softening, Unloading

MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=1e12, tau2=10.0).relaxation()
SHARE = 0.0444  # m; K^n = 4.4e8 N/m at E(0) = 10 GPa
F, D = 71.0, 1.14e-4


def bonds(series: PronySeries = MASTIC, count: int = 1, f_max: float = F, delta_max: float = D) -> CreepingSoftening:
    return CreepingSoftening(arms(series, np.full(count, SHARE)), np.full(count, f_max), np.full(count, delta_max))


def follow(law: CreepingSoftening, openings: np.ndarray, durations: np.ndarray) -> tuple[np.ndarray, BondState]:
    """Forces (steps,) of one bond along a path."""
    state, forces = law.at_rest(), []
    for opening, duration in zip(openings, durations, strict=True):
        at = np.array([opening])
        forces.append(float(law.force(state, at, duration)[0]))
        state = law.advance(state, at, duration)
    return np.array(forces), state


@given(st.lists(st.floats(-2e-5, 1.5e-4), min_size=1, max_size=20))
def test_what_does_not_relax_is_the_elastic_law(openings):
    slow = PronySeries(0.0, np.array([1e10]), np.array([1e30]))
    elastic = LinearSoftening(np.array([1e10 * SHARE]), np.array([F]), np.array([D]))
    reached, wanted = np.zeros(1), []
    for opening in openings:
        wanted.append(float(elastic.force(np.array([opening]), reached)[0]))
        reached = elastic.reached(np.array([opening]), reached)
    found, _ = follow(bonds(slow), np.array(openings), np.ones(len(openings)))
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9 * F)  # sums of increments for a product


def rate_onset(rate: float) -> float:
    """δ* of a bond pulled at a constant rate, from the closed form of its force."""

    def above(time: float) -> float:
        return SHARE * rate * float(np.sum(MASTIC.modulus * MASTIC.time * -np.expm1(-time / MASTIC.time))) - F

    return rate * brentq(above, 0, 1e4, xtol=1e-12)


@pytest.mark.parametrize("rate", [2e-8, 2e-7, 1e-5])
def test_onset_at_a_constant_rate(rate):
    onset = rate_onset(rate)
    errors = []
    for count in (200, 400, 800):
        steps = np.linspace(0, 1.5 * onset, count + 1)
        forces, state = follow(bonds(), steps[1:], np.diff(steps) / rate)
        errors.append(abs(float(state.onset[0]) / onset - 1))
        before = steps[1:] < 0.99 * onset
        time = steps[1:][before] / rate
        grown = -np.expm1(-np.divide.outer(time, MASTIC.time)) @ (MASTIC.modulus * MASTIC.time)
        assert forces[before] == pytest.approx(SHARE * rate * grown, rel=1e-11)  # hundreds of roundings
    assert errors[-1] < 2e-3
    assert errors[-1] < 0.6 * errors[0]  # the step that holds the onset: first order


def test_slower_is_longer():
    assert rate_onset(2e-8) > rate_onset(2e-7) > rate_onset(1e-5) > F / (SHARE * MASTIC.instantaneous)


def test_softening_is_a_straight_line_from_the_onset():
    openings = np.linspace(0, 1.2 * D, 4001)[1:]
    forces, state = follow(bonds(), openings, np.full(openings.size, 1e-3))
    onset = float(state.onset[0])
    after = openings > onset
    line = F * np.clip((D - openings[after]) / (D - onset), 0, 1)
    assert forces[after] == pytest.approx(line, rel=1e-9, abs=1e-9 * F)  # rounding of a quotient near zero
    assert forces.max() <= F * (1 + 1e-12)  # rounding
    area = np.trapezoid(forces[after], openings[after]) / (F * (D - onset) / 2)
    assert area == pytest.approx(1, abs=1e-3)  # the step across the onset


def test_creep_stops_where_softening_has_begun():
    law = bonds()
    _, state = follow(law, np.array([5e-5]), np.array([1.0]))
    assert state.softened.all()
    held = law.advance(state, np.array([5e-5]), 1e4)
    before, after = (law.force(s, np.array([5e-5]), 0.0) for s in (state, held))
    assert after == pytest.approx(before, rel=1e-15)  # the same numbers


def test_unloading_goes_to_the_origin_and_compression_is_elastic():
    law = bonds()
    _, state = follow(law, np.array([5e-5]), np.array([1.0]))
    full = float(law.force(state, np.array([5e-5]), 1.0)[0])
    assert float(law.force(state, np.array([2e-5]), 1.0)[0]) == pytest.approx(0.4 * full, rel=1e-12)  # a product
    pressed = law.force(state, np.array([-1e-6]), 1.0)
    assert pressed == pytest.approx(-1e-6 * SHARE * MASTIC.instantaneous, rel=1e-12)  # a product


def test_below_its_strength_a_bond_never_fails_by_opening_alone():
    # so slow that the force stays below f_max: far beyond delta_max the dashpot carries η v
    rate = 0.5 * F / (SHARE * MASTIC.viscosity)
    openings = np.linspace(0, 5 * D, 200)[1:]
    forces, state = follow(bonds(), openings, np.full(openings.size, openings[0] / rate))
    assert not state.softened.any()
    assert forces[-1] == pytest.approx(0.5 * F, rel=1e-6)  # arms have settled


def test_a_bond_that_reaches_its_strength_beyond_delta_max_breaks_at_once():
    rate = 0.9 * F / (SHARE * MASTIC.viscosity)
    slow = np.linspace(0, 1.5 * D, 300)[1:]
    openings = np.append(slow, [1.5 * D + 1e-6, 1.6 * D])
    durations = np.append(np.full(slow.size, slow[0] / rate), [1e-3, 1.0])
    forces, state = follow(bonds(), openings, durations)
    assert forces[-3] > 0.85 * F
    assert forces[-2:].tolist() == [0.0, 0.0]
    assert D < state.onset[0] < 1.5 * D + 1e-6


def test_undamaged_compression_creeps():
    law = bonds()
    _, state = follow(law, np.array([-1e-6]), np.array([0.0]))
    later = law.force(law.advance(state, np.array([-1e-6]), 50.0), np.array([-1e-6]), 0.0)
    assert later == pytest.approx(-1e-6 * SHARE * MASTIC.relaxation_modulus(50.0), rel=1e-12)  # an exponential


@pytest.mark.parametrize("unloading", list(Unloading))
def test_a_bond_that_crept_under_compression_softens_from_its_own_origin(unloading: Unloading) -> None:
    """δ* < 0: no force jumps, no secant is stiffer than K(0), and closed it is elastic from where it has no force."""
    law = replace(bonds(), unloading=unloading)
    stiffness = float(law.k_n[0])
    _, state = follow(law, np.array([-3e-6, -3e-6]), np.array([0.0, 400.0]))
    onset = float(law.onset(state, 0.0)[0])
    assert onset < 0
    below, above = (float(law.force(state, np.array([onset * (1 + s)]), 0.0)[0]) for s in (1e-9, -1e-9))
    # K(0) × 1e-9 δ* is 1e-8 of F, the slope of the branch less
    assert below == pytest.approx(F, rel=1e-6)
    assert above == pytest.approx(F, rel=1e-6)
    state = law.advance(state, np.array([onset + 1e-9]), 0.0)
    free = onset - F / stiffness  # K(0) leads from there to (δ*, f_max)
    for opening in (onset, 0.5 * (onset + free), free, free - 1e-6):
        force = float(law.force(state, np.array([opening]), 1.0)[0])
        assert force == pytest.approx(stiffness * (opening - free), rel=0.01, abs=0.02 * F)  # softened by a nanometre
        assert float(law.stored(law.advance(state, np.array([opening]), 0.0))[0]) >= 0


@pytest.mark.parametrize("unloading", list(Unloading))
def test_work_of_a_bond_that_crept_under_compression_is_accounted_for(unloading: Unloading) -> None:
    law = replace(bonds(), unloading=unloading)
    path = np.concatenate([np.linspace(0, -3e-6, 50), np.linspace(-3e-6, 1e-5, 4000), np.linspace(1e-5, -2e-6, 500)])
    state, work, used = law.at_rest(), 0.0, 0.0
    for a, b in pairwise(path):
        before, after = law.force(state, np.array([a]), 0.0), law.advance(state, np.array([b]), 0.05)
        work += 0.5 * float(before[0] + law.force(after, np.array([b]), 0.0)[0]) * (b - a)
        used += float(law.used(state, after, 0.05)[0])
        state = after
    assert state.softened.all()
    assert float(law.stored(state)[0]) + used == pytest.approx(work, rel=1e-4)  # trapezoids of the work


def test_work_is_stored_crept_or_spent_on_the_way_to_the_peak():
    law = bonds()
    openings = np.linspace(0, 0.9 * rate_onset(2e-7), 400)
    state, work, used = law.at_rest(), 0.0, 0.0
    for a, b in pairwise(openings):
        at, duration = np.array([b]), (b - a) / 2e-7
        before = float(law.force(state, np.array([a]), 0.0)[0])
        work += 0.5 * (before + float(law.force(state, at, duration)[0])) * (b - a)
        used += float(law.crept(state, at, duration)[0])
        state = law.advance(state, at, duration)
    assert float(law.stored(state)[0]) + used == pytest.approx(work, rel=1e-5)  # trapezoids of the work


def test_bonds_without_damage_never_soften():
    law = CreepingSoftening(arms(MASTIC, np.full(2, SHARE)), np.array([np.inf, F]), np.array([np.inf, D]))
    state = law.at_rest()
    for opening in np.linspace(0, 2 * D, 50):
        state = law.advance(state, np.full(2, opening), 1e-3)
    assert state.softened.tolist() == [False, True]
    force = law.force(state, np.full(2, 2 * D), 0.0)
    assert force[0] > F
    assert force[1] == 0
    assert np.isfinite(law.stored(state)).all()


def test_refusals():
    with pytest.raises(InputError, match=r"f_max = 0 N must be positive \(inf: the bond takes no damage\)"):
        bonds(f_max=0.0)
    with pytest.raises(InputError, match="delta_max = -1 m must be finite and positive"):
        bonds(delta_max=-1.0)
    with pytest.raises(InputError, match="delta_max = inf m must be finite and positive"):
        bonds(delta_max=np.inf)
    rise = arms(MASTIC, np.array([SHARE]))
    for name, value, told in (
        ("stiffness", -1.0, "stiffness = -1 N/m of the arms of a creeping bond must be finite and zero or positive"),
        ("time", 0.0, "time = 0 s of the arms of a creeping bond must be finite and positive"),
        ("left", np.nan, "left = nan N/m of the arms of a creeping bond must be finite and zero or positive"),
    ):
        with pytest.raises(InputError, match=told):
            CreepingSoftening(
                replace(rise, **{name: np.full_like(getattr(rise, name), value)}), np.array([F]), np.array([D])
            )
    with pytest.raises(InputError, match="2 bonds for the arms of 1"):
        CreepingSoftening(arms(MASTIC, np.array([SHARE])), np.full(2, F), np.full(1, D))


OPTIONS = [(s, u) for s in (Softening(), Softening("exponential"), Softening("bilinear-tail")) for u in Unloading]


@pytest.mark.parametrize(("shape", "unloading"), OPTIONS)
def test_without_time_it_is_the_law_without_creep(shape, unloading):
    law = replace(bonds(), softening=shape, unloading=unloading)
    plain, reached = CentralSoftening(law.k_n, law.f_max, law.delta_max, shape, unloading), np.zeros(1)
    state, used = law.at_rest(), np.zeros(1)
    for opening in np.array([[0.001, 0.3, 0.1, 0.7, -0.2, 0.6, 2.0, 5.0, 1.0, -0.1]]).T * D:
        force = law.force(state, opening, 0.0)
        assert force == pytest.approx(plain.force(opening, reached), abs=1e-11 * F)  # K(0) is a sum of arms
        after = law.advance(state, opening, 0.0)
        used = used + law.used(state, after, 0.0)
        state, reached = after, plain.reached(opening, reached)
        assert law.stored(state) == pytest.approx(plain.stored(opening, reached), abs=1e-11 * F * D)  # as above
        assert used == pytest.approx(plain.dissipated(reached), abs=1e-10 * F * D)  # asked for
        expected = np.minimum(reached, plain.delta_end) * (reached > plain.delta_peak)
        assert law.equivalent(state) == pytest.approx(expected, rel=1e-11)  # as above
    assert law.broken(state).all()


@pytest.mark.parametrize(("shape", "unloading"), OPTIONS)
def test_work_is_stored_or_used_up_through_onset_and_failure(shape, unloading):
    law = replace(bonds(), softening=shape, unloading=unloading)
    onset, state, work, used = rate_onset(2e-7), bonds().at_rest(), 0.0, 0.0
    path = np.concatenate([np.linspace(0, 30 * onset, 900), np.linspace(30 * onset, 5 * D, 300)])
    for a, b in pairwise(path):
        at, duration = np.array([b]), (b - a) / 2e-7
        before = float(law.force(state, np.array([a]), 0.0)[0])
        after = law.advance(state, at, duration)
        work += 0.5 * (before + float(law.force(after, at, 0.0)[0])) * (b - a)
        used += float(law.used(state, after, duration)[0])
        state = after
    assert float(law.stored(state)[0]) + used == pytest.approx(work, rel=1e-3)  # trapezoids of the work: second order
