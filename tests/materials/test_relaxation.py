"""Forces of viscoelastic bonds against closed forms, for steps of any length."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.materials.burgers import Burgers
from pipeline.materials.prony import PronySeries
from pipeline.materials.relaxation import (
    Arms,
    arms,
    crept,
    history_force,
    ramp,
    relax,
    stored,
    tangent,
    total,
)

MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0).relaxation()
SOLID = PronySeries(2e9, np.array([5e9, 1e9, 3e9]), np.array([1e-3, 2.0, 500.0]))
SHARE = np.array([0.04, 0.013])  # m, two bonds
steps = st.lists(st.floats(1e-6, 300.0), min_size=1, max_size=30)
materials = st.sampled_from([MASTIC, SOLID])


def history(bonds: Arms, moves: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Arm forces and openings after (change of opening, duration) of each step, alike for all bonds."""
    force, opening = bonds.relaxed(), np.zeros(len(bonds.left))
    for change, duration in moves:
        step = np.full(len(bonds.left), change)
        force, opening = relax(bonds, force, step, duration), opening + step
    return force, opening


@given(materials, steps)
def test_relaxation_step(material, durations):
    # a jump of 1 µm, then held: f(t) = K(t) δ however time is divided
    bonds = arms(material, SHARE)
    force, opening = history(bonds, [(1e-6, 0.0), *((0.0, d) for d in durations)])
    expected = SHARE * material.relaxation_modulus(sum(durations)) * 1e-6
    # thirty roundings of forces that began at K(0) δ
    assert total(bonds, force, opening) == pytest.approx(expected, rel=1e-12, abs=1e-18 * material.instantaneous)


@given(materials, steps)
def test_constant_rate(material, durations):
    # f(t) = v (K_∞ t + Σ K_i τ_i (1 − e^(−t/τ_i)))
    bonds, rate = arms(material, SHARE), 1e-8
    force, opening = history(bonds, [(rate * d, d) for d in durations])
    time = sum(durations)
    grown = material.infinity * time - np.sum(material.modulus * material.time * np.expm1(-time / material.time))
    assert total(bonds, force, opening) == pytest.approx(SHARE * rate * grown, rel=1e-12)  # thirty roundings


@given(materials, steps, steps)
def test_ramp_and_hold(material, rise, hold):
    bonds, rate = arms(material, SHARE), 1e-8
    force, opening = history(bonds, [*((rate * d, d) for d in rise), *((0.0, d) for d in hold)])
    ramped, held = sum(rise), sum(hold)
    decay = np.exp(-held / material.time) * -np.expm1(-ramped / material.time)
    kept = material.infinity * ramped + np.sum(material.modulus * material.time * decay)
    scale = 1e-12 * SHARE[0] * rate * material.viscosity  # sixty roundings of forces up to v Σ K τ
    assert total(bonds, force, opening) == pytest.approx(SHARE * rate * kept, rel=1e-12, abs=scale)


def test_creep_under_constant_force_follows_the_compliance():
    # hold the force by choosing each opening with the tangent: the opening is D(t) f, approached with the square of dt
    model = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0)
    bonds = arms(model.relaxation(), np.array([1.0]))
    gap = [_creep_error(model, bonds, count) for count in (40, 80, 160)]
    order = np.log2(np.array(gap[:-1]) / gap[1:])
    assert order == pytest.approx(2, abs=0.1)  # linear openings between steps: second order
    assert gap[-1] < 1e-5


def _creep_error(model: Burgers, bonds: Arms, count: int) -> float:
    force, opening = relax(bonds, bonds.relaxed(), np.array([model.d1]), 0.0), model.d1
    times = 600.0 * (np.arange(count + 1) / count) ** 2
    for duration in np.diff(times):
        change = (1 - history_force(bonds, force, duration)) / tangent(bonds, duration)
        force, opening = relax(bonds, force, change, duration), opening + change
    return abs(float(opening[0] / model.creep_compliance(600.0)) - 1)


@settings(max_examples=50)
@given(materials, st.lists(st.tuples(st.floats(-1e-6, 1e-6), st.floats(0.0, 1e3)), min_size=1, max_size=12))
def test_work_is_stored_or_crept_away(material, moves):
    # the work of a step is known in closed form from the arms' forces, independent of `crept`
    bonds = arms(material, SHARE)
    force, opening = bonds.relaxed(), np.zeros(2)
    work, used, scale = np.zeros(2), np.zeros(2), np.zeros(2)
    for change, duration in moves:
        step = np.full(2, change)
        done = _work(bonds, force, opening, change, duration)
        lost = crept(bonds, force, step, duration)
        assert (lost >= 0).all()
        work, used, scale = work + done, used + lost, scale + abs(done) + stored(bonds, force, opening)
        force, opening = relax(bonds, force, step, duration), opening + step
    # dozens of roundings of the energies that went in and out
    assert stored(bonds, force, opening) + used == pytest.approx(work, rel=1e-11, abs=1e-11 * scale.max() + 1e-300)


def _work(bonds: Arms, force: np.ndarray, opening: np.ndarray, change: float, duration: float) -> np.ndarray:
    """∫ f dδ of a step by Gauss–Legendre over pieces that begin ever nearer to its start."""
    node, weight = np.polynomial.legendre.leggauss(20)
    edges = np.concatenate([[0.0], np.logspace(-9, 0, 46)])
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    share = (middle[:, None] + half[:, None] * node).reshape(-1, 1, 1)
    x = duration * share / bonds.time
    arm = np.exp(-x) * force + bonds.stiffness * ramp(x) * change * share
    at = arm.sum(axis=2) + bonds.left * (opening + change * share[:, :, 0])
    return change * (half[:, None] * weight).ravel() @ at


def test_a_jump_meets_the_instantaneous_stiffness_and_long_waiting_the_lasting_one():
    bonds = arms(SOLID, SHARE)
    assert tangent(bonds, 0.0) == pytest.approx(bonds.instantaneous, rel=1e-15)  # one sum
    assert tangent(bonds, 1e12) == pytest.approx(bonds.left, rel=1e-6)  # Σ K τ/dt is left
    assert (history_force(bonds, np.ones((2, 3)), 1e12) == 0).all()


def test_tangent_is_the_derivative_of_the_force():
    bonds = arms(SOLID, SHARE)
    force, opening = history(bonds, [(1e-6, 3.0), (-4e-7, 0.1)])
    slope = (relax(bonds, force, opening + 1e-7, 7.0) - relax(bonds, force, opening, 7.0)).sum(axis=1) / 1e-7
    assert slope + bonds.left == pytest.approx(tangent(bonds, 7.0), rel=1e-9)  # linear: the quotient's round-off


def test_bonds_of_other_materials_do_not_mix():
    # each row of the arms is a bond of its own: stiff stone, creeping mastic and their interface side by side
    mastic, interface = (arms(m, np.array([0.03])) for m in (MASTIC, SOLID))
    both = Arms(
        np.vstack([np.pad(mastic.stiffness, ((0, 0), (0, 1))), interface.stiffness]),
        np.vstack([np.pad(mastic.time, ((0, 0), (0, 1)), constant_values=1.0), interface.time]),
        np.concatenate([mastic.left, interface.left]),
    )
    force, opening = history(both, [(1e-6, 2.0), (1e-6, 30.0), (0.0, 1.0)])
    for row, alone in enumerate((mastic, interface)):
        one, _ = history(alone, [(1e-6, 2.0), (1e-6, 30.0), (0.0, 1.0)])
        assert total(both, force, opening)[row] == pytest.approx(total(alone, one, opening[:1])[0], rel=1e-15)  # a sum
        kept = stored(both, force, opening)[row]
        assert kept == pytest.approx(stored(alone, one, opening[:1])[0], rel=1e-15)  # a sum


def test_the_state_before_is_left_alone():
    bonds = arms(MASTIC, SHARE)
    before = np.ones((2, 2))
    relax(bonds, before, np.ones(2), 3.0)
    assert (before == 1).all()


def test_ramp_near_zero():
    x = np.array([0.0, 1e-300, 1e-9, 1e-3])
    assert ramp(x) == pytest.approx(1 - x / 2 + x**2 / 6 - x**3 / 24, rel=1e-13)  # next term x⁴/120


@pytest.mark.parametrize("duration", [-1e-9, float("nan")])
def test_time_does_not_run_backwards(duration):
    bonds = arms(MASTIC, SHARE)
    with pytest.raises(InputError, match="does not run backwards"):
        relax(bonds, bonds.relaxed(), np.zeros(2), duration)
