"""Trials with creep in the truth: the mastic that is used, and the table."""

import numpy as np
import pytest

from pipeline.execution.progress import Silent
from pipeline.store.bundle import read_bundle
from pipeline.study.creep_trials import MASTIC, READINGS, CreepTrial, creep_table, creep_trials, creeping_test
from pipeline.study.request import Request


def test_the_mastic_creeps_by_what_is_said_of_it():
    at_once, early, late = MASTIC.creep_compliance([0.0, 5.0, 60.0])
    assert 1 / at_once == pytest.approx(10e9)
    assert early / at_once == pytest.approx(1.147, abs=1e-3)
    assert late / at_once == pytest.approx(1.793, abs=1e-3)
    assert READINGS[0] < 5 < 60 < READINGS[-1]  # what decides is inside the record


def test_medians_stand_at_the_foot_of_each_geometry():
    trials = [
        CreepTrial("seb, seed 1", (1.10, 0.95), (1.00, 1.01), (True, True), 1.2),
        CreepTrial("seb, seed 2", (1.30, 0.93), (1.02, 0.99), (True, False), 1.4),
        CreepTrial("dct, seed 1", (1.05, 0.99), (1.00, 1.00), (True, True), 1.2),
    ]
    table = creep_table(trials)
    assert "| seb, seed 2 | +30.0% | -7.0% | +2.0% | -1.0% | yes, no | +27.5% | +40.0% |" in table
    assert "| **median, seb** | +20.0% | -6.0% | +1.0% | +0.0% | | +18.7% | +30.0% |" in table
    assert "| **median, dct** | +5.0% | -1.0% | +0.0% | +0.0% | | +5.0% | +20.0% |" in table


def test_a_minimum_on_the_edge_of_the_grid_is_no_shift() -> None:
    trials = [CreepTrial(f"seb, seed {k}", (1.1, 1.0), (1.0, 1.0), (True, True), s) for k, s in ((1, np.nan), (2, 1.3))]
    table = creep_table(trials)
    assert "| seb, seed 1 | +10.0% | +0.0% | +0.0% | +0.0% | yes, yes | +10.0% | edge |" in table
    assert "| **median, seb** | +10.0% | +0.0% | +0.0% | +0.0% | | +10.0% | +30.0% |" in table


def test_a_test_opened_faster_creeps_less(tmp_path) -> None:
    largest = {}
    for faster in (1.0, 10.0):
        creeping_test(tmp_path / f"{faster:g}", Request(radius_mm=2.5), 1, Silent(), "equilibrium", faster)
        bundle = read_bundle(tmp_path / f"{faster:g}")
        assert bundle.loading.cmod_rate == pytest.approx(faster * 0.5e-3 / 60)
        largest[faster] = bundle.curve.peak()[1]
    assert largest[10.0] > largest[1.0] + 50.0  # N; ten times the noise


@pytest.mark.slow
def test_with_the_load_the_fit_with_creep_finds_the_truth_and_the_one_without_does_not(tmp_path) -> None:
    """Seen: 1.6 and -2.0 % off, without creep -4.4 and +16 %; up to 6 % are noise and the grid (docs/accuracy.md)."""
    [one] = creep_trials(tmp_path, ["seb"], [1], radius_mm=1.2, objective="both", engine="equilibrium", workers=1)
    assert one.viscoelastic == pytest.approx((1, 1), abs=0.06)
    assert one.elastic[1] > 1.1
