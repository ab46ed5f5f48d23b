"""Measurement effects against formulas; every effect says what it must."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.effects import checked, effect, library
from pipeline.gap.observation import Reading
from pipeline.gap.plan import Place, Plan
from pipeline.materials.elastic import Plane
from pipeline.materials.mixture import Mixture
from tests.gap.scene import sight

NAMES = {
    "fixture_compliance_um_per_kn", "sync_offset_s", "cmod_gain", "magnification", "lens_distortion",
    "drift_um_per_min", "load_gain", "creep", "modulus", "thermal_gradient", "support_friction", "eccentricity_mm",
    "notch_length_mm", "tip_damage", "softening_shape", "air_voids", "aggregate_strength", "interface_ratio",
    "shear_strength_ratio", "rate_law_per_decade",
}  # fmt: skip
MEASURING = [n for n, e in library().items() if isinstance(e, MeasurementEffect)]
PHYSICS = [n for n in library() if n not in MEASURING]
BEAM = SingleEdgeNotchedBeam(60e-3, 130e-3, 137e-3, 40e-3, 15e-3)
MIXTURE = Mixture(10e9, 50e9, 0.25, Plane.STRAIN, 71.0, 1.14e-4)


def act(name: str, value, field=None, load=None):
    seen = sight()
    s, p = seen.cmod.size, len(seen.points)
    reading = Reading(np.zeros((s, p, 2)) if field is None else field, np.zeros(s) if load is None else load)
    return seen, effect(name).distort(np.atleast_1d(np.asarray(value, float)), seen, reading)


def test_the_library_is_that_of_the_names():
    assert set(library()) == NAMES
    assert list(library()) == sorted(library())


@pytest.mark.parametrize("name", sorted(NAMES))
def test_every_effect_says_what_to_do_and_how_large_it_may_be(name):
    one = effect(name)
    assert one.says
    assert one.remedy
    assert one.kind in ("measurement", "physics")
    at = np.linspace(*one.magnitude.bounds, 20001)
    mass = np.trapezoid(np.exp(one.magnitude.log_density(at)), at)
    assert mass == pytest.approx(1.0, abs=1e-4)  # trapezoids of a smooth density


@pytest.mark.parametrize("name", MEASURING)
def test_no_effect_is_no_effect(name):
    seen = sight()
    rng = np.random.default_rng(0)
    field, load = rng.normal(size=(seen.cmod.size, 16, 2)) * 1e-5, rng.normal(size=seen.cmod.size) * 1e3
    none = np.zeros(effect(name).magnitude.directions)
    _, found = act(name, none, field, load)
    assert np.array_equal(found.field, field)
    assert np.array_equal(found.load, load)
    assert np.allclose(effect(name).field_at(none, seen, seen.cmod), seen.cmod, rtol=1e-12)
    assert np.allclose(effect(name).load_at(none, seen, seen.cmod), seen.cmod, rtol=1e-12)


@pytest.mark.parametrize("name", PHYSICS)
def test_no_physics_is_the_plan_as_it_was(name):
    plan = Plan(BEAM, MIXTURE)
    found = effect(name).change(0.0, plan)
    place = Place(np.array([[1e-3, 20e-3], [2e-3, 50e-3]]), np.array([1, 2]), BEAM)
    factors = found.factors(place)
    assert np.allclose([factors.stiffness, factors.strength, factors.opening], 1.0)
    assert found.specimen == BEAM


def test_a_fixture_of_20_um_per_kn_lets_go_40_um_under_2_kn():
    _, found = act("fixture_compliance_um_per_kn", 20.0, load=np.full(13, 2000.0))
    assert np.allclose(found.field, (0.0, -40e-6))


def test_a_fixture_follows_the_measured_load_where_there_is_one():
    """What the simulated load is off does not show in fields."""
    seen, half = sight(), np.where(np.arange(13) < 6, 1000.0, np.nan)
    one, reading = effect("fixture_compliance_um_per_kn"), Reading(np.zeros((13, 16, 2)), np.full(13, 2000.0))
    found = one.distort(np.array([20.0]), replace(seen, load=half), reading)
    assert np.allclose(found.field[:6], (0.0, -20e-6))
    assert np.allclose(found.field[6:], (0.0, -40e-6))
    assert np.array_equal(found.load, reading.load)


def test_a_frame_two_seconds_late_shows_an_earlier_opening():
    seen = sight()
    rate = 0.5e-3 / 60
    found = effect("sync_offset_s").field_at(np.array([2.0]), seen, seen.cmod)
    assert np.allclose(found[3:], seen.cmod[3:] - 2 * rate, rtol=1e-9)
    assert found[0] == 0.0  # before the loading began


def test_a_gauge_that_reads_too_much_looks_at_smaller_openings():
    seen = sight()
    for look in (effect("cmod_gain").field_at, effect("cmod_gain").load_at):
        assert np.allclose(look(np.array([0.1]), seen, seen.cmod) * 1.1, seen.cmod)


def test_a_picture_grows_about_its_centre():
    seen, found = act("magnification", 1e-3)
    assert np.allclose(found.field[-1], 1e-3 * (seen.points - seen.centre))
    assert np.allclose(found.field[0], found.field[-1] * seen.cmod[0] / seen.cmod[-1])


def test_a_lens_leaves_its_middle_and_what_stands_still():
    seen = sight()
    _, still = act("lens_distortion", 0.01)
    assert not still.field.any()
    moved = np.zeros((13, 16, 2))
    moved[..., 0] = 1e-5
    _, found = act("lens_distortion", 0.01, moved)
    arm = seen.points - seen.centre
    slope = 0.01 / seen.corner**2 * (np.sum(arm**2, axis=1) + 2 * arm[:, 0] ** 2)  # d(x|x|²)/dx, y held
    assert np.allclose(found.field[0, :, 0] / 1e-5 - 1, slope, rtol=1e-2)  # second order: 1e-5 m over 1e-2 m


def test_drift_has_a_direction():
    seen, found = act("drift_um_per_min", (3.0, -6.0))
    assert np.allclose(found.field[5], np.array([3e-6, -6e-6]) * seen.time[5] / 60)


def test_a_load_cell_multiplies():
    _, found = act("load_gain", 0.05, load=np.full(13, 1000.0))
    assert np.allclose(found.load, 1050.0)


def test_a_thermal_gradient_is_none_in_the_middle_and_spares_stone():
    plan = effect("thermal_gradient").change(0.4, Plan(BEAM, MIXTURE))
    place = Place(np.array([[0, 0.0], [0, 30e-3], [0, 60e-3], [0, 60e-3]]), np.array([1, 1, 1, 2]), BEAM)
    assert np.allclose(plan.factors(place).strength, (0.8, 1.0, 1.2, 1.0))


def test_values_outside_the_plausible_are_refused():
    with pytest.raises(InputError, match="plausible range"):
        checked("support_friction", -0.1)
    with pytest.raises(InputError, match="no effect 'friction'"):
        checked("friction", 0.1)
    with pytest.raises(InputError, match="hold 0"):
        Magnitude(1.0, 2.0, 1.0, "1")
