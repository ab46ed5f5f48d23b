"""Virtual tests whose mastic creeps: what the bundle holds, what the truth says, and what a fit makes of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.creep import CreepRecord, encode_creep
from pipeline.store.results import read_result
from pipeline.study.assembly import build_model
from pipeline.study.assembly import test_clock as clock_of  # no test
from pipeline.study.creep_trials import MASTIC, READINGS
from pipeline.study.creep_twins import CreepTwin, creep_twins, twin_table
from pipeline.study.filming import Clock
from pipeline.study.request import Request
from pipeline.study.trials import Trial
from pipeline.study.truth import draw_truth, made_already
from pipeline.study.virtual_test import run_test, virtual_test
from pipeline.twin.calibration import calibrated_factors


@pytest.fixture(scope="module")
def sheet(tmp_path_factory) -> Path:
    """A creep test as a laboratory might send it."""
    path = tmp_path_factory.mktemp("laboratory") / "mastic.csv"
    path.write_bytes(encode_creep(CreepRecord(READINGS, MASTIC.creep_compliance(READINGS))))
    return path


@pytest.fixture(scope="module")
def creeping(sheet, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("twins") / "creeping"
    virtual_test(folder, seed=4, radius_mm=2.5, creep=sheet)
    return folder


def load_of(bundle: Bundle, request: Request, seed: int = 4) -> float:
    """Load (N) at a quarter of the CMOD at peak, of one network and truth whatever the request's effects are."""
    rng = np.random.default_rng(seed)
    truth = draw_truth(replace(request, f_max=500.0, delta_max=1.1e-4), bundle, rng)
    curve = run_test(bundle, truth, request, Clock(), np.random.default_rng(seed)).exact_curve
    return float(np.interp(0.01e-3, curve.cmod, curve.load))


def test_the_bundle_holds_the_creep_test_and_the_time_of_its_frames(creeping: Path) -> None:
    bundle, truth = read_bundle(creeping), json.loads((creeping / "truth.json").read_text("utf-8"))
    assert bundle.creep is not None
    assert bundle.material.mastic_modulus is None  # 1/D₁ takes its place
    assert build_model(bundle).mixture.mastic_modulus == pytest.approx(1 / MASTIC.d1, rel=1e-6)  # of the fit to it
    assert truth["effects"] == {"creep": 1.0}
    assert truth["creep"]["eta1_gpa_s"] == pytest.approx(1500, rel=1e-3)
    assert truth["energy_error"] < 1e-3
    clock, end = clock_of(bundle), 0.5e-3
    assert clock.at(end) == pytest.approx(end / bundle.loading.cmod_rate, rel=1e-3)  # rows of a fifth of a second
    last = bundle.curve.time[np.argmin(np.abs(bundle.curve.cmod - end))]
    assert clock.at(end) == pytest.approx(last, abs=0.2)


def test_at_once_the_network_is_as_stiff_as_without_creep(creeping: Path) -> None:
    bundle = read_bundle(creeping)
    truth, laws = draw_truth(Request(), bundle, np.random.default_rng(1)), []
    for effect in ([("creep", 1.0)], None):
        test = run_test(bundle, truth, Request(effect=effect), Clock(), np.random.default_rng(2))
        laws.append(test.problem.law)
    slow, elastic = laws
    assert isinstance(slow, CreepingSoftening)
    assert isinstance(elastic, CentralSoftening)
    assert slow.k_n == pytest.approx(elastic.k_n, rel=1e-9)  # sums of arms
    assert np.array_equal(slow.f_max, elastic.f_max)
    assert slow.delta_max == pytest.approx(elastic.delta_max)


def test_more_creep_is_less_load(creeping: Path) -> None:
    bundle = read_bundle(creeping)
    wanted = [None, [("creep", 0.5)], [("creep", 1.0)]]
    loads = [load_of(bundle, Request(effect=effect)) for effect in wanted]
    assert np.all(np.diff(loads) < 0)
    assert loads[0] - loads[2] == pytest.approx(2 * (loads[0] - loads[1]), rel=0.2)  # little creep acts in proportion


def test_a_bundle_that_is_imitated_gives_its_creep_test(creeping: Path, tmp_path: Path) -> None:
    virtual_test(tmp_path / "again", seed=1, like=creeping, effect=[("creep", 0.5)])
    truth = json.loads((tmp_path / "again" / "truth.json").read_text("utf-8"))
    assert truth["creep"]["d2_per_gpa"] == pytest.approx(0.02, rel=1e-3)  # half of the growth
    assert read_bundle(tmp_path / "again").creep is not None


def test_creep_without_a_creep_test_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="needs a creep test: give --creep FILE"):
        virtual_test(tmp_path / "none", seed=1, radius_mm=2.5, effect=[("creep", 1.0)])


@pytest.mark.slow
def test_a_second_call_goes_on_and_may_fit_without_creep_too(tmp_path: Path) -> None:
    how = {"radius_mm": 2.5, "engine": "equilibrium", "workers": 1}
    [first] = creep_twins(tmp_path, ["seb"], [4], elastic=False, **how)
    assert first.elastic is None
    made = (tmp_path / "seb-4" / "truth.json").stat().st_mtime_ns
    [second] = creep_twins(tmp_path, ["seb"], [4], **how)
    assert (tmp_path / "seb-4" / "truth.json").stat().st_mtime_ns == made
    assert replace(second.viscoelastic, seconds=first.viscoelastic.seconds) == first.viscoelastic
    assert second.elastic is not None
    fits = [read_result(tmp_path / f"seb-4-both-{fit}")["viscoelastic"] for fit in ("viscoelastic", "elastic")]
    assert fits == [True, False]


def test_medians_and_worst_stand_at_the_foot() -> None:
    def trial(f_max: float, delta_max: float) -> Trial:
        return Trial("", f_max, delta_max, f_max * delta_max, (1.0, 1.0), True, False, True, 0.0, 1.0)

    twins = [CreepTwin(f"seb, seed {k}", trial(1 + s, 1.0), trial(1.2, 0.9)) for k, s in ((1, 0.01), (2, -0.05))]
    table = twin_table(twins)
    assert "| seb, seed 2 | -5.0% | +0.0% | -5.0% | yes, no | +20.0% | -10.0% | +8.0% | yes, no |" in table
    assert "| **median, seb** | -2.0% | +0.0% | -2.0% | | +20.0% | -10.0% | +8.0% | |" in table
    assert "| **worst, seb** | -5.0% | +0.0% | -5.0% | | +20.0% | -10.0% | +8.0% | |" in table
    assert "| **truth inside, seb** | 2 of 2 | 0 of 2 | | | 2 of 2 | 0 of 2 | | |" in table


def test_what_was_not_fitted_without_creep_leaves_its_cells_empty() -> None:
    table = twin_table([CreepTwin("dct, seed 1", Trial("", 0.9, 1.1, 0.99, (1.0, 1.0), True, True, True, 0, 1), None)])
    assert "| dct, seed 1 | -10.0% | +10.0% | -1.0% | yes, yes | | | | |" in table
    assert {line.count("|") for line in table.splitlines()} == {10}  # one table


@pytest.mark.parametrize(
    "text", [json.dumps({"factors": {**vars(calibrated_factors()), "strength": 1.0}}), "{}", "[", "1"]
)
def test_a_test_kept_from_other_factors_of_the_network_is_not_gone_on_with(text: str, tmp_path: Path) -> None:
    (tmp_path / "truth.json").write_text(text)
    with pytest.raises(InputError, match="other factors of the network"):
        made_already(tmp_path)
    (tmp_path / "truth.json").write_text(json.dumps({"factors": vars(calibrated_factors())}))
    assert made_already(tmp_path)
    assert not made_already(tmp_path / "elsewhere")
