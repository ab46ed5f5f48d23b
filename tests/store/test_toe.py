"""The foot of a record, against records whose foot is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.curve import LoadCurve
from pipeline.core.units import MM, UM
from pipeline.store.toe import fit_rise, without_foot

STIFFNESS = 1e8  # N/m


def clean(rows: int = 600, noise: float = 0.0, seed: int = 0) -> LoadCurve:
    """Straight to 2 kN at 0.02 mm, a round top, then falling; 1 µm a second."""
    cmod = np.linspace(0, 0.3 * MM, rows)
    load = np.where(cmod < 0.02 * MM, STIFFNESS * cmod, 2000 * (1 + np.tanh((cmod - 0.02 * MM) / (0.02 * MM))))
    fall = np.exp(-np.maximum(cmod - 0.05 * MM, 0) / (0.1 * MM))
    load = load * fall + np.random.default_rng(seed).normal(0, noise, rows)
    return LoadCurve(cmod / UM, cmod, load, 2 * cmod)


@settings(max_examples=40)
@given(st.floats(-0.2, 0.2), st.floats(0.1, 10.0))
def test_an_offset_of_the_gauge_is_taken_off(offset_mm, scale):
    curve = clean()
    moved = LoadCurve(curve.time, scale * curve.cmod + offset_mm * MM, curve.load)
    fixed, told = without_foot(moved)
    at = fixed.load_at(scale * np.array([0.01, 0.1]) * MM)
    assert np.allclose(at, curve.load_at(np.array([0.01, 0.1]) * MM), rtol=1e-6)  # linear between 600 rows
    assert f"CMOD = {offset_mm:.6g} mm" in told[0] or abs(offset_mm) < 1e-6


def test_a_clean_record_keeps_its_numbers():
    curve = clean()
    fixed, told = without_foot(curve)
    assert np.allclose(fixed.cmod, curve.cmod, rtol=0, atol=1e-15)  # metres: round-off
    assert np.array_equal(fixed.load, curve.load)
    assert np.allclose(fixed.load_line, curve.load_line, rtol=0, atol=1e-15)  # metres: round-off
    assert len(told) == 1


def test_doing_it_twice_does_nothing_more():
    once, _ = without_foot(with_toe(clean(noise=3.0)))
    twice, told = without_foot(once)
    assert np.allclose(twice.cmod, once.cmod, rtol=0, atol=0.1 * UM)  # what rows of the toe within the slack leave
    assert twice.load.size == once.load.size
    assert not any("cut" in sentence for sentence in told)


def with_toe(curve: LoadCurve) -> LoadCurve:
    """10 s of waiting, then a parabola over 6 µm of extra opening that ends on the line at 300 N."""
    wait = np.arange(-16.0, -6.0)
    seat = np.linspace(0, 1, 40)[:-1]
    join = int(np.flatnonzero(curve.load >= 300)[0])
    load = np.concatenate([np.zeros(10), 300 * seat**2, curve.load[join:]])
    cmod = np.concatenate([np.zeros(10), seat * (curve.cmod[join] + 6 * UM), curve.cmod[join:] + 6 * UM])
    time = np.concatenate([wait, -6 + seat * (curve.time[join] + 6), curve.time[join:]])
    return LoadCurve(time, cmod, load, 2 * cmod)


def test_waiting_and_toe_are_cut_and_cmod_counts_from_the_extended_rise():
    curve = clean()
    fixed, told = without_foot(with_toe(curve))
    assert "CMOD = 0.006 mm" in told[0]
    assert any("waiting, seating and toe" in sentence for sentence in told)
    at = np.array([0.005, 0.015, 0.05, 0.2]) * MM
    assert np.allclose(fixed.load_at(at), curve.load_at(at), rtol=5e-3)  # up to the slack of CMOD at the join
    assert np.allclose(fixed.time_at(at[1:]), curve.time_at(at[1:]), rtol=1e-6)  # clock untouched: linear interpolation
    assert fixed.cmod[0] == 0
    assert fixed.load[0] == 0
    assert fixed.time[0] == pytest.approx(curve.time[0], abs=0.2)  # extrapolated along the rise of 1 µm a second
    assert np.all(np.diff(fixed.time) > 0)


def test_a_seating_load_under_a_zeroed_gauge_is_given_back():
    """The gauge was set to zero at 200 N: CMOD lacks 200 N/K = 2 µm."""
    curve = clean()
    first = int(np.flatnonzero(curve.load >= 200)[0])
    seated = LoadCurve(curve.time[first:], curve.cmod[first:] - curve.cmod[first], curve.load[first:])
    fixed, told = without_foot(seated)
    at = np.array([0.01, 0.05]) * MM
    assert np.allclose(fixed.load_at(at), curve.load_at(at), rtol=1e-6)  # linear between 600 rows
    assert fixed.cmod[0] == 0
    assert any("A row at zero load" in sentence for sentence in told)
    assert fixed.time[0] == pytest.approx(0.0, abs=0.01)  # the rise is exactly straight here


@pytest.mark.parametrize("seed", range(5))
def test_noise_moves_the_foot_little(seed):
    """σ = 10 N on K = 1e8 N/m is 0.1 µm a row; the line through some 12 rows meets zero within 0.15 µm."""
    foot = fit_rise(clean(noise=10.0, seed=seed), clean().cmod).foot
    assert abs(foot) < 0.3 * UM  # twice that


def test_single_wild_rows_do_not_move_the_foot():
    curve = clean(2000)
    cmod = curve.cmod.copy()
    cmod[[45, 60, 75]] += 30 * UM
    assert abs(fit_rise(curve, cmod).foot) < 0.01 * UM  # medians: three of some forty rows


def test_a_record_without_a_rise_is_left_and_said():
    x = np.array([0.0, 1.0, 2.0, 3.0])
    curve = LoadCurve(x, x * UM, np.array([0.0, 900.0, 500.0, 100.0]))
    fixed, told = without_foot(curve)
    assert fixed is curve
    assert told == ["The rise has too few rows to tell a toe from it: CMOD was left as it is."]
