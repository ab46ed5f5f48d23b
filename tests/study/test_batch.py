"""A batch of specimens: one folder each, and no test made twice."""

from __future__ import annotations

import json

import pytest

from pipeline.gap.library import shipped
from pipeline.study.batch import Batch
from pipeline.twin.calibration import calibrated_factors


def test_specimens_of_other_kinds_lie_apart(tmp_path):
    batches = [Batch(tmp_path), Batch(tmp_path, "dct"), Batch(tmp_path, radius_mm=1.5)]
    folders = [batch.folder(seed) for batch in batches for seed in (1, 2)]
    assert len(set(folders)) == 6
    assert folders[0] == tmp_path / "seb-1-0001"  # what earlier runs left is found again


def test_a_test_is_made_once_with_what_was_asked_for(tmp_path, monkeypatch):
    made = []

    def virtual_test(out, **asked):
        made.append(asked)
        out.mkdir()
        (out / "truth.json").write_text(json.dumps({"factors": vars(calibrated_factors())}))

    monkeypatch.setattr("pipeline.study.batch.virtual_test", virtual_test)
    for _ in range(2):
        Batch(tmp_path, "dct", 1.5).make(tmp_path / "test", 7, {"modulus": 0.1, "creep": 1.0})
    effect = [("creep", 1.0), ("modulus", 0.1)]
    asked = {"seed": 7, "geometry": "dct", "radius_mm": 1.5, "pitch": 1.5}
    assert made == [{**asked, "creep": None, "effect": effect, "poissons_ratio": None}]  # what creeps carries no shear
    sheet = tmp_path / "creep.csv"
    Batch(tmp_path, "dct", 1.5, creep=sheet).make(tmp_path / "still", 7, {"modulus": 0.1})
    still = [("creep", 0.0), ("modulus", 0.1)]  # nothing creeps unless asked for
    assert made[1:] == [{**asked, "creep": sheet, "effect": still, "poissons_ratio": 0.1}]


def test_specimens_are_networks_of_all_kinds(tmp_path, monkeypatch):
    made = []

    def virtual_test(out, *, pitch, poissons_ratio, **asked):
        made.append((pitch, poissons_ratio))

    monkeypatch.setattr("pipeline.study.batch.virtual_test", virtual_test)
    for seed in range(9000, 9006):
        Batch(tmp_path).make(tmp_path / f"{seed}", seed)
    assert len(set(made)) == 6
    assert {ratio for _, ratio in made} == {None, 0.1}


def test_the_entry_is_of_the_geometry_and_radius(tmp_path):
    [one, *_] = shipped()
    fine = Batch(tmp_path, one.domain.geometry, 1e3 * one.domain.radius[0]).entry([one])
    assert fine.domain == one.domain
    at = one.domain.radius[0] / one.domain.learnt_at
    assert fine.apparent["notch_length_mm"] == pytest.approx(at * one.apparent["notch_length_mm"])  # of finer particles
    assert fine.apparent["interface_ratio"] == one.apparent["interface_ratio"]
    with pytest.raises(ValueError, match="is empty"):
        Batch(tmp_path).entry([])
