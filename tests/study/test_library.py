"""The commands `library …` on results of `identify`."""

from __future__ import annotations

import ast
import csv
import inspect
import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from helpers.bundles import make_bundle
from helpers.commands import run

from pipeline.store.bundle import read_bundle
from pipeline.study import identify, library
from pipeline.study.comparison import pair
from pipeline.study.library import entry_of, with_start

RESULT = {
    "command": "identify",
    "version": "1",
    "bundle": "seb-07",
    "geometry": "seb",
    "thickness_mm": 40.0,
    "temperature_c": -12.0,
    "cmod_rate_mm_per_min": 0.5,
    "bond_area_mm2": 24.0,
    "engine": "equilibrium",
    "objective": "fields",
    "f_max_n": 72.0,
    "delta_max_m": 1.2e-4,
    "bond_fracture_energy_j_per_m2": 360.0,
    "interval_95": {"f_max_n": [68.0, 76.0], "delta_max_m": [1.1e-4, 1.3e-4]},
    "interval_95_bond_fracture_energy_j_per_m2": [345.0, 375.0],
    "covariance": [[4.0, -5e-6], [-5e-6, 2.5e-11]],
    "peak_load_n": 2900.0,
    "cmod_at_peak_mm": 0.05,
    "peak_load_mismatch": 0.01,
    "accepted": True,
    "status": "accepted",
}


def result(folder: Path, **changes: object) -> Path:
    """A folder with the result.json of an identification."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(json.dumps(RESULT | changes))
    return folder


def refused(*line: object) -> str:
    """The one message with which a command ends."""
    ended = run(*line)
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert ended.stderr.count("cohesive-bpm: ") == 1
    assert "fault of the program" not in ended.stderr
    return ended.stderr


@pytest.fixture
def three(tmp_path) -> Path:
    """A library of two replicates and of another mixture, colder and in DC(T)."""
    file = tmp_path / "mixtures.h5"
    first = result(tmp_path / "a")
    second = result(tmp_path / "b", bundle="seb-08", f_max_n=75.0)
    third = result(
        tmp_path / "c", bundle="dct-01", geometry="dct", thickness_mm=50.0, bond_area_mm2=30.0, f_max_n=120.0,
        temperature_c=-24.0, bond_fracture_energy_j_per_m2=480.0,
    )  # fmt: skip
    assert run("library", "add", file, first, second, "--mixture", "paper").exit_code == 0
    assert run("library", "add", file, third, "--mixture", "stiff", "--note", "aged").exit_code == 0
    return file


def test_what_identify_writes_is_what_the_library_reads():
    parts = (identify.identification_result, identify.estimate_result, identify.optimum_result)
    trees = [ast.parse(inspect.getsource(part)) for part in parts]
    dictionaries = [d for tree in trees for d in ast.walk(tree) if isinstance(d, ast.Dict)]
    written = {k.value for d in dictionaries for k in d.keys if isinstance(k, ast.Constant)}
    assert set(RESULT) <= written
    assert set(library.NEEDED) <= written


def test_added_entries_are_listed_and_filtered(three):
    shown = run("library", "list", three)
    assert shown.exit_code == 0
    lines = shown.stdout.splitlines()
    assert len(lines) == 4
    assert "seb-07" in lines[1]
    assert "68–76" in lines[1]
    assert lines[3].split()[1:5] == ["stiff", "dct-01", "dct", "-24"]
    assert lines[3].endswith("aged")
    assert len(run("library", "list", three, "--mixture", "paper").stdout.splitlines()) == 3
    assert len(run("library", "list", three, "--temperatures-c", "-30,-20").stdout.splitlines()) == 2
    assert "holds no such entry" in run("library", "list", three, "--mixture", "x").stdout


def test_the_exported_table_has_units_and_all_digits(three, tmp_path):
    ended = run("library", "export", three, tmp_path / "mixtures.csv", "--geometry", "seb")
    assert ended.exit_code == 0
    with open(tmp_path / "mixtures.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2
    assert float(rows[0]["f_max_n"]) == 72.0
    assert float(rows[0]["f_max_low_n"]) == 68.0
    assert float(rows[1]["traction_mpa"]) == pytest.approx(75 / 24, rel=1e-8)  # nine digits
    assert float(rows[0]["covariance"]) == -5e-6
    assert rows[0]["accepted"] == "true"
    assert rows[0]["source"].endswith("a")


def test_comparison_leaves_numbers_figures_and_a_page(three, tmp_path):
    out = tmp_path / "out"
    ended = run("library", "compare", three, "-o", out)
    assert ended.exit_code == 0, ended.stderr
    found = json.loads((out / "result.json").read_text())
    assert [row["tests"] for row in found["groups"]] == [2, 1]
    spread = np.std([3.0, 3.125], ddof=1) / np.mean([3.0, 3.125])
    assert found["groups"][0]["traction_mpa"]["coefficient_of_variation"] == pytest.approx(spread, rel=1e-9)  # sums
    by = {(row["first"], row["second"]): row for row in found["pairs"]}
    assert len(by) == 3
    keys = [row["key"] for row in found["entries"]]
    assert by[keys[0], keys[2]]["traction_ratio"] == pytest.approx(4 / 3, rel=1e-12)  # 120/30 over 72/24
    assert by[keys[0], keys[2]]["differs"]
    assert not by[keys[0], keys[1]]["differs"]
    for name in ("report.html", "parameters.png", "traction.png", "energy.png"):
        assert (out / name).stat().st_size > 1000


def test_the_chance_of_a_difference_is_that_of_two_degrees_of_freedom(tmp_path):
    alike = {"covariance": [[0.72**2, 0], [0, (1.2e-6) ** 2]]}  # 1 % each, independent
    first = entry_of(RESULT | alike, tmp_path, "m", "", False)
    second = entry_of(RESULT | alike | {"f_max_n": 72.0 * math.exp(0.03)}, tmp_path, "m", "", False)
    scale = math.exp(-0.03)  # the second's own 1 % is of a larger value
    squared = 0.03**2 / (0.01**2 * (1 + scale**2))
    assert pair(first, second)["chance"] == pytest.approx(math.exp(-squared / 2), rel=1e-9)  # closed form of χ²(2)


def test_without_covariance_there_is_no_chance(tmp_path):
    first = entry_of(RESULT, tmp_path, "m", "", False)
    bare = entry_of(RESULT | {"covariance": None, "interval_95": None, "f_max_n": 99.0}, tmp_path, "m", "", False)
    row = pair(first, bare)
    assert math.isnan(row["chance"])
    assert row["differs"] is False


def test_the_start_of_a_bundle_comes_from_the_nearest_temperature(three, tmp_path):
    bundle = make_bundle(tmp_path / "coarse")
    text = (bundle / "experiment.toml").read_text()
    ended = run("library", "start", three, bundle, "--mixture", "paper")
    assert ended.exit_code == 0, ended.stderr
    test = read_bundle(bundle)
    # the bundle's own radius and thickness: f_max/(2 r t) is taken over; of equals the one added last
    area = 2 * test.model.radius * test.specimen.thickness
    assert test.start.f_max_n == pytest.approx(75 / 24e-6 * area, rel=1e-5)  # six digits are written
    assert test.start.delta_max_m == pytest.approx(1.2e-4, rel=1e-5)  # likewise
    changed = (bundle / "experiment.toml").read_text()
    kept = [line for line in text.splitlines() if not line.startswith(("f_max_n", "delta_max_m"))]
    assert [line for line in changed.splitlines() if not line.startswith(("f_max_n", "delta_max_m"))] == kept


def test_a_library_of_several_mixtures_asks_which(three, tmp_path):
    bundle = make_bundle(tmp_path / "coarse")
    before = (bundle / "experiment.toml").read_text()
    assert "name one with --mixture (paper, stiff)" in refused("library", "start", three, bundle)
    assert "holds no such entry" in refused("library", "start", three, bundle, "--mixture", "x")
    assert (bundle / "experiment.toml").read_text() == before


@pytest.mark.parametrize(
    "text",
    [
        "[a]\nx = 1\n",
        "[a]\nx = 1\n\n[start]\nf_max_n = 1.0 # old\ndelta_max_m = 2.0\n\n[b]\nf_max_n = 7\n",
        "[start]\ndelta_max_m = 2.0\n[b]\ny = 2",
        "# [start]\n[ start ] # here\n",
        "[start]",
    ],
)
def test_start_is_written_wherever_it_stands(tmp_path, text):
    entry = entry_of(RESULT, tmp_path, "m", "", False)
    before, after = tomllib.loads(text), tomllib.loads(with_start(text, 88.5, 1.3e-4, entry))
    assert after.pop("start") == {"f_max_n": 88.5, "delta_max_m": 1.3e-4}
    before.pop("start", None)
    assert after == before


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"command": "simulate"}, "holds no result of `identify`"),
        ({"bond_area_mm2": None}, "has no bond_area_mm2: give the `identify` command again"),
        ({"accepted": False, "status": "on the edge"}, "was not accepted (on the edge)"),
    ],
)
def test_what_cannot_be_relied_on_is_refused(tmp_path, changes, sentence):
    folder = result(tmp_path / "a", **changes)
    assert sentence in refused("library", "add", tmp_path / "x.h5", folder, "--mixture", "m")
    assert not (tmp_path / "x.h5").exists()


def test_an_estimate_that_was_not_accepted_is_kept_anyway_and_marked(tmp_path):
    folder = result(tmp_path / "a", accepted=False)
    assert run("library", "add", tmp_path / "x.h5", folder, "--mixture", "m", "--anyway").exit_code == 0
    assert "not accepted" in run("library", "list", tmp_path / "x.h5").stdout


def test_other_faults_get_one_message(three, tmp_path):
    assert "does not exist" in refused("library", "list", tmp_path / "none.h5")
    assert "result.json does not exist" in refused("library", "add", three, tmp_path / "none", "--mixture", "m")
    assert "already, as" in refused("library", "add", three, tmp_path / "a", "--mixture", "m")
    assert "a mixture needs a name" in refused("library", "add", three, result(tmp_path / "d"), "--mixture", " ")
    assert "1 entries of" in refused("library", "compare", three, "-o", tmp_path / "o", "--mixture", "stiff")
    assert "must be the key of one entry" in refused("library", "remove", three, "zz")
    three.write_bytes(b"text")
    assert "no readable HDF5 file" in refused("library", "list", three)


def test_an_entry_is_removed(three):
    key = run("library", "list", three).stdout.splitlines()[1].split()[0]
    assert "seb-07" in run("library", "remove", three, key).stdout
    assert len(run("library", "list", three).stdout.splitlines()) == 3
