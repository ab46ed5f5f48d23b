"""Effects on the hexagonal lattice: none is none, statics, symmetry, continuity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import InputError, UnavailableError
from pipeline.core.problem import Role
from pipeline.core.units import MM
from pipeline.equilibrium.solve import solve
from pipeline.gap.effects import effect
from pipeline.gap.plan import Plan
from pipeline.materials.burgers import Burgers
from pipeline.store.bundle import read_bundle
from pipeline.store.creep import CreepRecord
from pipeline.store.new import Contents, write_bundle
from pipeline.study.assembly import Model, build_model
from pipeline.study.diagnose import unlearnt
from pipeline.study.effects import Band, held_to, lattice_problem, physics_effects, planned, settled
from pipeline.study.engines import engine
from tests.helpers.bundles import DELTA_MAX, F_MAX, coarse_experiment, edit

MASTIC = Burgers(0.1e-9, 0.04e-9, 1500e9, 15.0)
ELASTIC = 0.004 * MM  # of CMOD: nothing softens yet
SIMULATED = [
    "modulus", "thermal_gradient", "support_friction", "eccentricity_mm", "notch_length_mm", "tip_damage",
    "softening_shape", "air_voids", "aggregate_strength", "interface_ratio", "rate_law_per_decade",
]  # fmt: skip


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Model:
    folder = tmp_path_factory.mktemp("beam")
    write_bundle(folder, coarse_experiment("beam"), Contents())
    return build_model(read_bundle(folder))


def changed(model: Model, cmod: float = ELASTIC, **effects: float):
    problem = model.problem(F_MAX, DELTA_MAX, frames=np.array([cmod]), cmod_max=1.02 * cmod)
    return lattice_problem(model, planned(model.bundle.specimen, model.mixture, effects), problem, F_MAX, DELTA_MAX)


def load(model: Model, cmod: float = ELASTIC, **effects: float) -> float:
    return float(solve(changed(model, cmod, **effects)).curve.load_at(np.array([cmod]))[0])


def test_an_unchanged_plan_is_the_same_problem(model):
    problem = model.problem(F_MAX, DELTA_MAX, frames=np.array([ELASTIC]), cmod_max=ELASTIC)
    found = changed(model)
    for name in ("k_n", "f_max", "delta_max"):
        assert np.array_equal(getattr(found.law, name), getattr(problem.law, name))
    assert found.grips == problem.grips


@pytest.mark.parametrize("name", SIMULATED)
def test_an_effect_of_nothing_changes_nothing(model, name):
    plan = effect(name).change(0.0, Plan(model.bundle.specimen, model.mixture))
    problem = model.problem(F_MAX, DELTA_MAX, frames=np.array([ELASTIC]), cmod_max=ELASTIC)
    found = lattice_problem(model, plan, problem, F_MAX, DELTA_MAX)
    assert np.allclose(found.law.k_n, problem.law.k_n)
    assert np.allclose(found.law.f_max, problem.law.f_max)


def test_modulus_scales_the_elastic_load(model):
    assert load(model, modulus=0.2) == pytest.approx(1.2 * load(model), rel=1e-6)  # solver's tolerance


def test_round_voids_soften_by_the_cube(model):
    assert load(model, air_voids=0.1) == pytest.approx(0.9**3 * load(model), rel=1e-6)  # solver's tolerance


def test_a_load_beside_the_notch_line_bends_it_less_and_alike_either_way(model):
    middle, right, left = (load(model, eccentricity_mm=e) for e in (0.0, 6.0, -6.0))
    assert right == pytest.approx(left, rel=0.02)  # the lattice is symmetric to a point, not to a line, and coarse
    assert right > middle


def test_far_from_the_notch_the_load_follows_from_statics(model):
    """The moment at the notch is P (S/2 − e)/2; under the platen itself the stress is no beam's (Saint-Venant)."""
    moments = [load(model, eccentricity_mm=e) * (65 - e) for e in (20.0, 30.0, 40.0)]
    assert moments == pytest.approx([moments[1]] * 3, rel=0.02)  # shear, and a platen of three particles


def test_a_longer_notch_is_weaker_without_steps(model):
    lengths = np.linspace(-4, 3, 8)
    found = np.array([load(model, notch_length_mm=x) for x in lengths])
    falls = -np.diff(found)
    assert (falls > 0).all()
    halves = falls[:6].reshape(3, 2)  # each bond goes in two steps, and takes as much with either
    assert np.allclose(halves[:, 0] / halves[:, 1], 1.0, atol=0.1)


def test_a_notch_longer_by_whole_bonds_is_that_of_a_longer_notch(model):
    specimen = replace(model.bundle.specimen, notch_length=19 * MM)
    longer = build_model(replace(model.bundle, specimen=specimen))
    problem = longer.problem(F_MAX, DELTA_MAX, frames=np.array([ELASTIC]), cmod_max=ELASTIC)
    exact = float(solve(problem).curve.load_at(np.array([ELASTIC]))[0])
    # the clip gauge of so coarse a lattice takes the plane of 16 mm of flank, of which the longer notch has more
    assert load(model, notch_length_mm=4.0) == pytest.approx(exact, rel=3e-3)


def test_rubbing_supports_carry_a_share_of_the_moment_and_stay_at_their_height(model):
    problem = changed(model, support_friction=0.3)
    free, solution = load(model), settled(problem, solve(problem))
    gained = float(solution.curve.load_at(np.array([ELASTIC]))[0]) / free
    # inward forces μP/2 at the bottom take μP/2 × (lever above the bottom) off P S/4; the lever lies between the tip
    # and the back of the ligament, 15 to 60 mm
    low, high = (1 / (1 - 2 * 0.3 * lever / 130) for lever in (15, 60))
    assert low < gained < high
    for grip in problem.grips:
        if grip.role is Role.REACT:
            heights = solution.displacement[:, grip.index, 1] @ grip.weight
            assert np.allclose(heights, 0, atol=1e-12)


def test_damage_at_the_tip_keeps_the_rest_of_the_branch(model):
    before, after = changed(model).law, changed(model, tip_damage=0.4).law
    hurt = after.f_max != before.f_max
    assert 0 < hurt.sum() < 0.02 * hurt.size
    assert np.allclose(after.f_max[hurt], 0.6 * before.f_max[hurt])
    opening = np.broadcast_to(0.7 * before.delta_max, before.delta_max.shape)
    there = before.force(np.where(hurt, opening, 0.0), np.zeros(hurt.size))
    assert np.allclose(after.force(np.where(hurt, opening, 0.0), np.zeros(hurt.size))[hurt], there[hurt])


def test_damage_is_held_to_the_band(model):
    path = np.array([[0, 15], [0, 40]]) * MM
    found = held_to(changed(model), Band(path, 6 * MM))
    middle = found.particles.position[found.bonds.pairs].mean(axis=1)
    away = (np.abs(middle[:, 0]) > 6 * MM) & (middle[:, 1] < 40 * MM)
    assert np.isinf(found.law.f_max[away]).all()
    inside = (np.abs(middle[:, 0]) < 5 * MM) & (np.abs(middle[:, 1] - 30 * MM) < 5 * MM)
    assert np.isfinite(found.law.f_max[inside]).all()


def test_a_rate_law_is_the_law_of_the_mouths_rate_and_its_value(model):
    plain, found = changed(model).law, changed(model, rate_law_per_decade=0.1).law
    assert found.per_decade == 0.1
    for name in ("k_n", "f_max", "delta_max"):
        assert np.array_equal(getattr(found, name), getattr(plain, name))
    band = Band(np.array([[0, 15], [0, 40]]) * MM, 6 * MM)
    held = [held_to(changed(model, rate_law_per_decade=v), band).law for v in (0.0, 0.1)]
    assert np.array_equal(held[0].f_max, held[1].f_max)
    both = changed(model, rate_law_per_decade=0.1, softening_shape=0.5).law
    assert both.law.softening == changed(model, softening_shape=0.5).law.softening


def test_a_rate_law_lowers_the_load_of_every_softening_by_the_engine_of_that_name(model):
    equilibria, late = engine("equilibrium").solve, 0.08 * MM
    for shape in (0.0, 0.7):
        with_it, without = (
            equilibria(changed(model, late, rate_law_per_decade=v, softening_shape=shape)).curve.load.max()
            for v in (0.2, 0.0)
        )
        assert 0.85 < with_it / without < 0.99  # 0.3 to 0.6 decades slower than the mouth


@pytest.fixture(scope="module")
def creeping_model(tmp_path_factory) -> Model:
    """The same beam with a creep test of its mastic."""
    folder, time = tmp_path_factory.mktemp("creeping") / "beam", np.geomspace(0.5, 300, 40)
    write_bundle(folder, coarse_experiment("beam"), Contents(creep=CreepRecord(time, MASTIC.creep_compliance(time))))
    return build_model(read_bundle(folder))


def test_creep_takes_its_part_of_the_load_in_the_time_of_the_test(creeping_model):
    """All mastic: the load of a mouth that opens at constant rate is the mean of E over the time that it took."""
    took = ELASTIC / creeping_model.bundle.loading.cmod_rate
    series = MASTIC.like(10e9, 0.7).relaxation()
    mean = float(series.modulus @ (series.time * -np.expm1(-took / series.time))) / took
    found = load(creeping_model, creep=0.7) / load(creeping_model)
    assert found == pytest.approx(mean / 10e9, rel=1e-4)  # solver's tolerance
    assert found < 0.995
    assert load(creeping_model, creep=0.0) == load(creeping_model)


def test_creep_without_a_creep_test_is_refused(model):
    with pytest.raises(InputError, match=r"has no creep\.csv: add the creep compliance"):
        changed(model, creep=1.0)


def test_a_rate_law_of_bonds_that_creep_is_refused(creeping_model):
    with pytest.raises(UnavailableError, match="creep or carry shear"):
        changed(creeping_model, rate_law_per_decade=0.1, creep=1.0)


def test_shear_strength_is_refused_where_bonds_carry_no_shear(model):
    with pytest.raises(InputError, match="no effect"):
        changed(model, shear_strength_ratio=0.1)


@pytest.fixture(scope="module")
def sliding_model(tmp_path_factory) -> Model:
    """The same beam at ν = 0.15, where bonds carry shear."""
    folder = tmp_path_factory.mktemp("sliding") / "beam"
    write_bundle(folder, coarse_experiment("beam"), Contents())
    edit(folder, poissons_ratio="0.15")
    return build_model(read_bundle(folder))


@pytest.mark.parametrize("name", [n for n in SIMULATED if n != "tip_damage"] + ["shear_strength_ratio"])
def test_an_effect_of_nothing_changes_nothing_where_bonds_carry_shear(sliding_model, name):
    model = sliding_model
    plan = effect(name).change(0.0, Plan(model.bundle.specimen, model.mixture))
    problem = model.problem(F_MAX, DELTA_MAX, frames=np.array([ELASTIC]), cmod_max=ELASTIC)
    found = lattice_problem(model, plan, problem, F_MAX, DELTA_MAX)
    for name in ("k_n", "k_s", "f_max", "f_shear", "delta_max", "delta_shear"):
        assert np.allclose(getattr(found.law, name), getattr(problem.law, name)), name


def test_shear_strength_matters_where_bonds_carry_shear_once_they_soften(sliding_model):
    weak, same = changed(sliding_model, shear_strength_ratio=-0.5).law, changed(sliding_model).law
    assert np.allclose(weak.f_shear, 0.5 * same.f_shear)
    assert np.array_equal(weak.f_max, same.f_max)
    assert load(sliding_model, shear_strength_ratio=-0.5) == pytest.approx(load(sliding_model), rel=1e-6)  # elastic
    late = 0.05 * MM
    assert load(sliding_model, late, shear_strength_ratio=-0.5) < 0.99 * load(sliding_model, late)


def test_modulus_scales_the_elastic_load_where_bonds_carry_shear(sliding_model):
    exact = 1.2 * load(sliding_model)
    assert load(sliding_model, modulus=0.2) == pytest.approx(exact, rel=1e-6)  # solver's tolerance


def test_bonds_outside_the_band_neither_open_nor_slide(sliding_model):
    found = held_to(changed(sliding_model), Band(np.array([[0, 15], [0, 40]]) * MM, 6 * MM)).law
    assert np.array_equal(np.isinf(found.f_max), np.isinf(found.f_shear))
    assert np.isinf(found.f_max).any()
    assert np.isfinite(found.f_max).any()


def test_the_diagnosis_warns_of_bonds_that_its_library_does_not_know(model, sliding_model):
    assert ["one material" in told for told in unlearnt(model)] == [True]  # and no word of shear
    assert "poissons_ratio = 0.15" in unlearnt(sliding_model)[0]


def test_damage_at_the_tip_is_refused_where_bonds_carry_shear(sliding_model):
    with pytest.raises(UnavailableError, match="bonds that carry no shear"):
        changed(sliding_model, tip_damage=0.3)


def test_a_rate_law_is_refused_where_bonds_carry_shear(sliding_model):
    with pytest.raises(UnavailableError, match="creep or carry shear"):
        changed(sliding_model, rate_law_per_decade=0.1)


def test_only_physics_is_simulated():
    assert physics_effects([("modulus", 0.1)]) == {"modulus": 0.1}
    with pytest.raises(InputError, match="use virtual-test"):
        physics_effects([("load_gain", 0.1)])
    with pytest.raises(InputError, match="given twice"):
        physics_effects([("modulus", 0.1), ("modulus", 0.2)])
