"""Trials of the diagnosis: sizes that are drawn, what is kept, what the table counts."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.gap.effects import effect, library
from pipeline.gap.library import parse, shipped, written
from pipeline.store.results import plain
from pipeline.study.batch import Batch
from pipeline.study.gap_calibration import answer, calibrate, drawn, sized
from pipeline.study.gap_confusion import summary, table
from pipeline.study.gap_library import UNMET, make_library
from pipeline.study.gap_trials import Bench, Trial, _apart, read_trial

FREE = Trial(
    seed=9100,
    effects={},
    without=(),
    verdict="none needed",
    named=(),
    log_bayes={"none": 0.0, "cmod_gain": -2.0, "modulus": -1.0},
    tested=2,
    gate="",
    estimates={"cmod_gain": (0.0, -0.01, 0.01), "modulus": (0.1, -0.2, 0.4)},
    limits={"cmod_gain": 0.02, "modulus": None},
    classes=(),
    closure=None,
    parameters=(0.9, 1.1, 0.9, 1.1),
    runs=40,
)
FOUND = replace(
    FREE,
    effects={"cmod_gain": 0.08},
    verdict="cause",
    named=("cmod_gain",),
    log_bayes={"none": 0.0, "cmod_gain": 90.0, "modulus": 5.0},
    estimates={"cmod_gain": (0.079, 0.07, 0.09), "modulus": (0.1, -0.2, 0.4)},
    closure=(0.9, 0.8, 1.0),
)
WRONG = replace(FOUND, effects={"modulus": 0.4})
LACKING = replace(FOUND, without=("cmod_gain",), verdict="outside the library", named=(), gate="opening")


def test_sizes_are_plausible_and_of_the_range_that_is_asked_for():
    for seed in range(20):
        found = drawn(library(), 6, np.random.default_rng(seed))
        assert len(dict(found)) == 6
        for name, value in found:
            size = effect(name).magnitude
            assert size.low <= value <= size.high
            assert 0.149 * size.high <= abs(value) <= size.high  # three digits


def test_an_effect_without_a_limit_is_as_large_as_is_plausible_and_no_larger():
    assert sized("cmod_gain", None, 3.0) == effect("cmod_gain").magnitude.high
    assert sized("cmod_gain", 0.02, 2.0, -1.0) == -0.04
    assert sized("tip_damage", 0.2, 2.0, -1.0) == 0.4  # has one sign only


def test_a_trial_is_read_as_it_was_kept(tmp_path):
    file = tmp_path / "trial.json"
    for one in (FREE, FOUND, LACKING):
        file.write_text(json.dumps(plain(asdict(one))), "utf-8")
        assert read_trial(file) == one


def test_the_table_counts_what_was_passed_named_and_missed():
    entry = replace(shipped()[0], temperature=2.0)
    told = summary([FREE, FOUND, WRONG, LACKING], entry)
    assert "1 tests without effects: 1 passed, 0 named" in told
    assert "2 with one (1 detectable): 1 named right, 1 wrong" in told
    assert "1 with one that the library lacks: 1 outside the library, 0 named" in told
    rows = table([FREE, FOUND, LACKING], entry).splitlines()
    assert len(rows) == 5
    assert "| 4.0 |" in rows[3]
    assert "not in the library" in rows[4]
    assert "(opening)" in rows[4]


def test_an_answer_is_right_by_its_label():
    assert answer(FREE).truth == "none"
    assert answer(FOUND).truth == "cmod_gain"


def kept(folder, seeds) -> None:
    """Libraries as a run of `make_library` leaves them."""
    for name in UNMET.values():
        file = folder / name
        file.write_text(written([replace(shipped()[0], seeds=seeds)], {}), "utf-8")


def test_the_librarys_own_specimens_are_refused(tmp_path):
    kept(tmp_path, (9000, 9023))
    with pytest.raises(InputError, match="made the library"):
        calibrate(Batch(tmp_path), tmp_path / "library.json", tmp_path, [9023, 9024])


def test_halves_too_small_to_learn_from_are_refused_before_anything_is_made(tmp_path):
    with pytest.raises(InputError, match="7 specimens are too few"):
        make_library(Batch(tmp_path / "out"), tmp_path / "library.json", range(9000, 9007))
    assert not (tmp_path / "out").exists()


def test_every_specimen_is_judged_by_what_was_learnt_on_the_other_kind(tmp_path, monkeypatch):
    judged, file = [], tmp_path / "library.json"
    kept(tmp_path, (9000, 9023))
    file.write_text(written([replace(shipped()[0], temperature=9.0)], {}), "utf-8")

    def unseen(batch, learnt, seeds):
        judged.append((batch.slides(*seeds), learnt.name))
        return [Bench(batch, *seeds, shipped()[0])]

    monkeypatch.setattr("pipeline.study.gap_calibration.unseen", unseen)
    trials = "pipeline.study.gap_calibration.specimen_trials"
    monkeypatch.setattr(trials, lambda bench, _: [replace(FOUND, seed=bench.seed)])
    calibrate(Batch(tmp_path), file, tmp_path, [9102, 9103])
    assert sorted(judged) == [(False, "with-shear.json"), (True, "without-shear.json")]
    [entry] = parse(json.loads(file.read_text("utf-8")))
    assert entry.temperature != 9.0
    assert entry.tests == 2


def test_paths_lie_apart_where_both_are():
    one = np.array([[0, 15], [2, 20], [2, 40]]) * 1e-3
    two = np.array([[0, 15], [2, 20], [2, 30], [9, 31]]) * 1e-3
    assert _apart(one, one) == 0
    assert _apart(one, two) == pytest.approx(7e-3)
