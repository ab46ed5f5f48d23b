"""Identification of a specimen whose mastic creeps: with creep in the model the truth, without it another strength."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.bundles import DELTA_MAX, F_MAX, coarse_experiment, edit, make_bundle

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.materials.burgers import Burgers
from pipeline.store.creep import CreepRecord
from pipeline.store.new import Contents, write_bundle
from pipeline.study.assembly import test_clock as clock_of  # no test
from pipeline.study.identify import identify
from pipeline.study.simulate import simulate

GPA = 1e9
MASTIC = Burgers(0.1 / GPA, 0.04 / GPA, 1500 * GPA, 15.0)
"""1/D₁ is the modulus of the bundle; in the 5 s to the peak the compliance grows by a seventh."""


def record():
    time = np.geomspace(0.5, 300, 40)
    return CreepRecord(time, MASTIC.creep_compliance(time))


def found(bundle, out, **how):
    identify(bundle, out, objective="fields", placements=0, **how)
    return json.loads((out / "result.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def creeping(tmp_path_factory):
    return make_bundle(tmp_path_factory.mktemp("bundles") / "creeping", creep=record())


@pytest.mark.slow
def test_the_viscoelastic_fit_finds_the_truth_and_the_elastic_one_more_strength(creeping, tmp_path):
    """Fields depend on f_max/K: a mastic that has softened by then looks like one of larger f_max over its first K."""
    with_creep = found(creeping, tmp_path / "with", viscoelastic=True)
    without = found(creeping, tmp_path / "without")
    assert with_creep["viscoelastic"]
    assert with_creep["accepted"]
    assert with_creep["f_max_n"] == pytest.approx(F_MAX, rel=0.05)  # noise alone: a standard deviation of 2 %
    assert with_creep["delta_max_m"] == pytest.approx(DELTA_MAX, rel=0.05)
    low, high = with_creep["interval_95"]["f_max_n"]
    assert low < F_MAX < high
    assert without["f_max_n"] > 1.05 * with_creep["f_max_n"]


@pytest.mark.parametrize("rest", [0.0, 30.0])
def test_the_clock_starts_when_the_mouth_opens(rest):
    """What a specimen waits for, unloaded, before the machine starts is no time to creep in."""
    time = np.arange(0.0, rest + 60.0, 0.2)
    cmod = 8e-6 * np.maximum(time - rest, 0.0)
    clock = clock_of(SimpleNamespace(curve=LoadCurve(time, cmod, 1e7 * cmod)))
    assert clock.at(3e-4) == pytest.approx(3e-4 / 8e-6, abs=0.01)  # between two rows the mouth opens evenly
    assert clock.at(1e-6) == pytest.approx(1e-6 / 8e-6, abs=0.2)  # within a row of the start


def test_a_creeping_test_is_simulated_in_equilibria(tmp_path):
    """The command with --law burgers: less load than without, most of it late."""
    loads = []
    bundle = tmp_path / "beam"
    write_bundle(bundle, coarse_experiment("beam"), Contents(creep=record()))
    for law in ("burgers", None):
        out = tmp_path / str(law)
        simulate(bundle, out, f_max=F_MAX, delta_max=DELTA_MAX, law=law, engine="equilibrium")
        result = json.loads((out / "result.json").read_text("utf-8"))
        assert result["energy_error"] < 1e-3
        loads.append(result["peak_load_n"])
    assert 0.9 * loads[1] < loads[0] < loads[1]


def test_a_bundle_without_creep_is_refused_before_anything_runs(tmp_path):
    plain = make_bundle(tmp_path / "plain")
    edit(plain, temperature_c="-12.0")
    with pytest.raises(InputError, match=r"has no creep\.csv: add the creep compliance"):
        identify(plain, tmp_path / "out", viscoelastic=True)
    assert not list((tmp_path / "out").glob("simulations/*"))
