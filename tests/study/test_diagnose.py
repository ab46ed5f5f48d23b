"""The command from bundle to report: the contract of result.json, channels that are missing, going on."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError, MissingFileError
from pipeline.core.field import DisplacementField
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.gap.effects import library
from pipeline.gap.library import nearest, parse, shipped, written
from pipeline.store.bundle import read_bundle
from pipeline.store.fields import read_fields, write_fields
from pipeline.study.diagnose import diagnose
from pipeline.study.diagnose_sight import abscissae, clear_of, crack_path, own_path, seen, sides
from pipeline.study.diagnose_together import folders, warnings_of_each
from pipeline.study.virtual_test import virtual_test

BEAM = SingleEdgeNotchedBeam(60e-3, 130e-3, 137e-3, 40e-3, 15e-3)
GRID = (0.8, 1.0, 1.25)
KEPT = {"modulus", "creep"}  # of the physics effects: one that is simulated, one that cannot be
KEYS = {
    "verdict", "named", "probability", "set_90", "equivalence_classes", "cannot_exclude", "estimate", "where",
    "closure", "detection_limit", "parameters_before", "parameters_after", "separate_by",
}  # fmt: skip


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("gap") / "let-go"
    virtual_test(folder, seed=5, radius_mm=2.0, effect=[("fixture_compliance_um_per_kn", 40.0)])
    return folder


def run(bundle: Path, out: Path) -> dict:
    without = [n for n, e in library().items() if e.kind == "physics" and n not in KEPT]
    diagnose([bundle], out, grid=GRID, without=without, workers=1)
    return json.loads((out / "result.json").read_text("utf-8"))


@pytest.mark.slow
def test_a_bundle_is_diagnosed_and_the_same_call_goes_on(bundle, tmp_path):
    result = run(bundle, tmp_path / "out")
    assert set(result) >= KEYS
    assert (
        "fixture_compliance_um_per_kn" in result["named"]
    )  # the library does not hold at 2 mm: others may stand beside
    estimate = result["estimate"]["fixture_compliance_um_per_kn"]
    assert estimate["value"] == pytest.approx(40, rel=0.1)  # particles of 2 mm: two µm in forty
    assert sum(result["probability"].values()) == pytest.approx(1.0)
    assert list(result["not_tested"]) == ["creep"]
    assert any("particles of 2 mm" in w for w in result["warnings"])  # outside what the library holds for
    assert (tmp_path / "out" / "report.html").exists()
    kept = sorted((tmp_path / "out" / "simulations").iterdir())
    again = run(bundle, tmp_path / "out")
    assert sorted((tmp_path / "out" / "simulations").iterdir()) == kept
    assert again["probability"] == result["probability"]


@pytest.mark.slow
@pytest.mark.parametrize(("lacking", "told"), [("fields.h5", "no displacement fields"), ("load_cmod.csv", "no load")])
def test_it_works_with_one_channel_and_says_what_it_cannot_see(bundle, tmp_path, lacking, told):
    part = tmp_path / "part"
    shutil.copytree(bundle, part)
    (part / lacking).unlink()
    result = run(part, tmp_path / "out")
    assert any(told in remark for remark in result["remarks"])
    assert {cell["channel"] for cell in result["where"]} == {"load" if lacking == "fields.h5" else "field"}


@pytest.mark.slow
def test_replicates_are_read_together_and_predict_each_other(bundle, tmp_path):
    other = tmp_path / "other"
    virtual_test(other, seed=6, radius_mm=2.0, effect=[("fixture_compliance_um_per_kn", 40.0)])
    without = [n for n, e in library().items() if e.kind == "physics" and n not in KEPT]
    told = diagnose([bundle, other], tmp_path / "out", grid=GRID, without=without, workers=1)
    result = json.loads((tmp_path / "out" / "result.json").read_text("utf-8"))
    assert set(result) >= KEYS | {"bundles", "transfer"}
    assert "2 tests" in told
    assert any("particles of 2 mm" in w for w in result["warnings"])
    alone = [json.loads((tmp_path / "out" / n / "result.json").read_text("utf-8")) for n in ("let-go", "other")]
    for label in ("none", "fixture_compliance_um_per_kn", "modulus"):
        middle = np.median([r["log_bayes"][label] for r in alone])
        assert result["log_bayes"][label] == pytest.approx(middle, abs=1e-9)
    rows = [t for t in result["transfer"] if t["explanation"] == "fixture_compliance_um_per_kn"]
    assert {t["target"] for t in rows} == {"let-go", "other"}
    for row in rows:  # the same set-up: the compliance of one is that of the other
        assert row["carried"] == ["f_max", "delta_max", "fixture_compliance_um_per_kn"]
        assert row["channels"]["field"]["fraction"] > 0.5
    assert (tmp_path / "out" / "report.html").exists()
    with pytest.raises(InputError, match="holds the results of bundle 'let-go \\+ other'"):
        diagnose([bundle], tmp_path / "out")


def test_warnings_of_single_tests_are_passed_on_by_name():
    told = warnings_of_each({"a": ["hot", "old"], "b": ["old"], "c": ["old", "wet"]})
    assert told == ["a: hot", "old", "c: wet"]


def test_two_bundles_of_one_name_are_told_apart_by_their_folders(bundle, tmp_path):
    again = read_bundle(shutil.copytree(bundle, tmp_path / "again"))
    assert list(folders([read_bundle(bundle), again])) == ["let-go", "again"]
    with pytest.raises(InputError, match="the same name"):
        folders([again, again])


def test_the_order_of_points_in_the_field_file_does_not_matter(bundle, tmp_path):
    one = seen(read_bundle(bundle))
    turned = tmp_path / "turned"
    shutil.copytree(bundle, turned)
    field = read_fields(bundle / "fields.h5")
    order = np.random.default_rng(0).permutation(len(field.points))
    shuffled = DisplacementField(
        field.points[order], field.displacement[:, order], field.valid[:, order], field.std[:, order], field.abscissa
    )
    write_fields(turned / "fields.h5", shuffled)
    two = seen(read_bundle(turned))
    assert np.array_equal(one.observation.sight.points, two.observation.sight.points)
    assert np.array_equal(one.observation.reading.field, two.observation.reading.field, equal_nan=True)
    assert np.allclose(one.path, two.path, atol=1e-6)  # sums in another order


def test_a_bundle_without_anything_measured_is_refused(bundle, tmp_path):
    part = tmp_path / "part"
    shutil.copytree(bundle, part)
    (part / "fields.h5").unlink()
    (part / "load_cmod.csv").unlink()
    with pytest.raises(MissingFileError, match="neither"):
        seen(read_bundle(part))


def torn(path, step: float = 1.5e-3, noise: float = 4e-7) -> DisplacementField:
    """Two halves that part by 0.2 mm along a path x(y), up to y = 40 mm."""
    x, y = np.meshgrid(np.arange(-18e-3, 18.1e-3, step), np.arange(6e-3, 45e-3, step))
    points = np.column_stack([x.ravel(), y.ravel()])
    opening = 1e-4 * np.clip((40e-3 - points[:, 1]) / 25e-3, 0, None)
    side = np.where(points[:, 0] > path(points[:, 1]), 1.0, -1.0)
    field = np.column_stack([side * opening, np.zeros(len(points))])
    field = field + noise * np.random.default_rng(0).standard_normal(field.shape)
    frames = np.stack([0 * field, field / 2, field])
    shape = frames.shape[:2]
    return DisplacementField(points, frames, np.ones(shape, bool), np.full(shape, noise), np.arange(3.0))


@pytest.mark.parametrize("step", [1.5e-3, 0.75e-3])
def test_the_crack_path_is_found_to_a_millimetre(step):
    def truth(y):
        return 2e-3 * np.sin((y - 15e-3) / 8e-3)

    found = crack_path(torn(truth, step), BEAM)
    low = (found[:, 1] > 17e-3) & (found[:, 1] < 36e-3)
    assert low.sum() > 8
    # the coarse way: half a step, and the median of three; the fine one goes straight on where its windows meet the tip
    assert np.abs(found[low, 0] - truth(found[low, 1])).max() < (0.75 * step if step > 1e-3 else 1e-3)


def test_a_field_without_a_crack_has_no_path():
    whole = torn(lambda y: 0 * y)
    still = DisplacementField(whole.points, 0 * whole.displacement, whole.valid, whole.std, whole.abscissa)
    assert crack_path(still, BEAM) is None


def test_points_know_their_flank_and_their_distance():
    path = np.array([[0, 15], [4, 25], [4, 40]]) * 1e-3
    points = np.array([[3, 16], [3, 30], [6, 30], [9, 30]]) * 1e-3
    assert sides(points, path).tolist() == [1, -1, 1, 1]
    assert clear_of(points, path).tolist() == [False, False, False, True]


def test_the_models_own_path_is_that_of_its_broken_bonds():
    y = np.arange(15.5, 50, 1.0)
    position = np.vstack([np.column_stack([0.1 * y - 1, y]), np.column_stack([0.1 * y + 1, y])]) * 1e-3
    pairs = np.column_stack([np.arange(y.size), y.size + np.arange(y.size)])
    found = own_path(position, pairs, (y < 40).astype(float), np.array(BEAM.tip))
    inner = found[(found[:, 1] > 17e-3) & (found[:, 1] < 37e-3)]
    assert np.allclose(inner[:, 0], 0.1 * inner[:, 1], atol=1e-4)  # weighted over 2 mm, symmetric


def test_simulations_reach_beyond_what_a_gauge_may_hide():
    curve = LoadCurve(np.arange(5.0), np.linspace(0, 6e-4, 5), np.array([0, 3.0, 2, 1, 0]))
    stations = np.array([1e-4, 3e-4, 5e-4])
    found = abscissae(stations, curve)
    assert found.field[-1] > 5.2e-4
    assert (np.diff(found.load) > 0).all()


def test_the_library_that_ships_is_sound():
    for entry in shipped():
        values = np.linalg.eigvalsh(entry.discrepancy.correlation)
        assert values.min() > 0
        assert entry.temperature >= 1
        assert entry.discrepancy.samples >= 4
    one = nearest(shipped(), "seb", 1e-3)
    again = parse(json.loads(written([one], {})))[0]
    assert np.allclose(again.discrepancy.amplitude, one.discrepancy.amplitude, rtol=1e-9)
