"""From speckle images to results, by the commands: against known truth, and no image measured twice."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.bundles import edit
from helpers.commands import run
from helpers.films import MM_PER_PX, STEP_PX
from scipy.spatial import cKDTree

from pipeline.core.field import DisplacementField
from pipeline.dic.gauge import opening
from pipeline.store.bundle import read_bundle
from pipeline.store.fields import read_fields, write_fields
from pipeline.store.layouts import DIC, IDENTIFY
from pipeline.store.results import read_arrays, read_result

PX = MM_PER_PX * 1e-3  # m
NEAR = 12 * PX  # m; as the contract of the correlation counts what is near a crack
KEYS = {
    *("points", "valid_fraction", "split_fraction", "noise_px", "crack_tip_px", "subsets_per_second"),
    *("sync_offset_s", "sync_std_s", "version", "command", "seconds"),
}


@pytest.fixture(scope="module")
def measured(film: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command makes of the film."""
    out = tmp_path_factory.mktemp("measured") / "out"
    done = run("dic", film, "-o", out, "--workers", "1")
    assert done.exit_code == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def both(film: Path, measured: Path) -> tuple[DisplacementField, DisplacementField]:
    """Measured and exact fields at the same points."""
    seen, exact = read_fields(measured / "fields.h5"), read_fields(film / "truth.h5")
    apart, number = cKDTree(exact.points).query(seen.points)
    here = apart < 1e-9
    assert here.mean() > 0.95  # the others have their centre beside the specimen
    pick = DisplacementField(
        seen.points[here], seen.displacement[:, here], seen.valid[:, here], seen.std[:, here], seen.abscissa
    )
    exact = DisplacementField(
        pick.points,
        exact.displacement[:, number[here]],
        exact.valid[:, number[here]],
        exact.std[:, number[here]],
        exact.abscissa,
    )
    return pick, exact


def torn(exact: DisplacementField, reach: float) -> np.ndarray:
    """Points in whose subset the last exact field jumps by more than a tenth of a pixel, and all within `reach`."""
    tree = cKDTree(exact.points)
    pairs = tree.query_pairs(1.5 * STEP_PX * PX, output_type="ndarray")
    jump = np.linalg.norm(exact.displacement[-1][pairs[:, 0]] - exact.displacement[-1][pairs[:, 1]], axis=1)
    sites = np.unique(pairs[jump > 0.3 * PX])
    return tree.query_ball_point(exact.points[sites], reach).size and np.isin(
        np.arange(len(exact.points)), np.concatenate(tree.query_ball_point(exact.points[sites], reach)).astype(int)
    )


def test_the_bundle_is_in_order_and_says_what_it_holds(film):
    done = run("check", film)
    assert done.exit_code == 0, done.stderr
    assert "29 speckle images" in done.stdout  # 25, and four more at rest
    assert not (film / "fields.h5").exists()


def test_the_result_has_the_keys_of_the_contract(measured):
    result = read_result(measured)
    assert set(result) >= KEYS
    assert len(result["crack_tip_px"]) == result["frames"] == 29
    assert result["command"] == "dic"
    for name in ("crack", "opening", "clock", "displacement", "contact_sheet", "quality"):
        assert (measured / f"{name}.png").stat().st_size > 10_000
    assert "data:image/png" in (measured / "report.html").read_text("utf-8")


def test_displacements_scatter_about_the_truth_as_stated(both):
    seen, exact = both
    far = ~torn(exact, 25 * PX)
    off = (seen.displacement - exact.displacement)[1:, far]
    use = seen.valid[1:, far]
    assert use.mean() > 0.99
    ratio = np.sqrt(np.mean((off[use] / seen.std[1:, far][use][:, None]) ** 2))
    # 1.0 but for the bend of the network's triangles within a subset, and the spread of the noise factor at rest
    assert 0.8 < ratio < 1.25
    assert np.abs(np.mean(off[use], axis=0)).max() < 0.003 * PX  # interpolation's bias, and the mean of the reference


def test_near_the_crack_few_points_are_wrong(both):
    seen, exact = both
    near = torn(exact, NEAR)
    assert near.sum() > 40
    off = np.linalg.norm(seen.displacement - exact.displacement, axis=-1)[5:, near]
    use = seen.valid[5:, near]
    assert use.mean() > 0.6  # a network's crack is a zigzag of facets as long as a subset: one straight cut fails there
    assert (off[use] > 0.1 * PX).mean() < 0.02  # the contract's 1 % for smooth cracks, twice
    assert np.median(off[use]) < 0.03 * PX  # the contract's bound on the rms


def test_the_clock_is_found_within_its_error(film, measured):
    result, truth = read_result(measured), json.loads((film / "truth.json").read_text("utf-8"))
    assert abs(truth["sync_offset_s"]) > 0.2  # something to be found
    assert abs(result["sync_offset_s"] - truth["sync_offset_s"]) < 4 * result["sync_std_s"]  # four deviations
    assert result["sync_std_s"] < 0.3


def test_the_opening_in_the_field_is_that_of_the_clip_gauge(film, measured):
    arrays, curve = read_arrays(measured, DIC), read_bundle(film).curve
    cmod = curve.cmod_at(arrays["frames/record_time_s"])
    off = (arrays["frames/opening_m"] - cmod)[np.isfinite(cmod)][1:]
    std = arrays["frames/opening_std_m"][np.isfinite(cmod)][1:]
    clock = read_result(measured)["sync_std_s"] * 0.5e-3 / 60  # m; what its own error makes of the rate
    assert np.sqrt(np.mean(off**2)) < 2 * np.hypot(np.sqrt(np.mean(std**2)), clock)  # two deviations: few frames


def test_noise_is_checked_at_rest(measured):
    result = read_result(measured)
    assert result["frames_at_rest"] in (4, 5)  # four, and one more where the loading has only just begun
    assert 0.8 < result["noise_factor"] < 1.25  # white noise was put in; 4 frames of 800 points that overlap
    assert 0.005 < result["noise_px"] < 0.02


def test_the_crack_grows_from_the_notch_along_the_true_one(film, measured, both):
    result, camera = read_result(measured), read_bundle(film).camera
    assert result["crack_tip_px"][0] is None
    tips = np.array([tip for tip in result["crack_tip_px"] if tip is not None])
    assert len(tips) >= 10
    assert tips[-1][1] < camera.origin_px[1] - 15 / MM_PER_PX  # above the notch tip, 15 mm from the mouth
    profile, exact = read_arrays(measured, DIC), both[1]
    jumps = exact.points[torn(exact, 0.1 * PX)]
    off = cKDTree(jumps).query(profile["crack/path_m"][:-1])[0]  # the last node is the tip, ahead of what parts yet
    assert np.median(off) < 1.5 * STEP_PX * PX  # the path smooths a zigzag of facets of 24 px
    assert off.max() < 5 * STEP_PX * PX
    assert profile["crack/opening_m"][0] == pytest.approx(0.29e-3, rel=0.12)  # CMOD of the last frame; a wedge above it
    assert np.all(np.diff(profile["crack/closing_m"]) <= 0)


def test_a_second_call_measures_nothing_again(film, measured, tmp_path):
    out = shutil.copytree(measured, tmp_path / "out")
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
    done = run("dic", film, "-o", out)
    assert done.exit_code == 0
    assert "28 of 28 images are kept from an earlier run" in done.stderr
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()} == before


def test_another_scale_measures_the_fields_again_but_no_image(film, measured, tmp_path):
    bundle, out = shutil.copytree(film, tmp_path / "film"), shutil.copytree(measured, tmp_path / "out")
    edit(bundle, sync_offset_s="0.25")
    before = {path: path.stat().st_mtime_ns for path in (out / "frames").iterdir()}
    done = run("dic", bundle, "-o", out)
    assert done.exit_code == 0, done.stderr
    assert {path: path.stat().st_mtime_ns for path in (out / "frames").iterdir()} == before
    assert (read_result(out)["sync_offset_s"], read_result(out)["sync_std_s"]) == (0.25, None)
    stamp = read_arrays(out, DIC)["frames/stamp_s"]
    np.testing.assert_allclose(read_fields(out / "fields.h5").abscissa, stamp - 0.25, atol=1e-9)  # round-off


def test_without_a_record_the_camera_keeps_its_own_time(film, measured, tmp_path):
    bundle, out = shutil.copytree(film, tmp_path / "film"), shutil.copytree(measured, tmp_path / "out")
    (bundle / "load_cmod.csv").unlink()
    done = run("dic", bundle, "-o", out)
    assert done.exit_code == 0, done.stderr
    assert "28 of 28 images are kept" in done.stderr
    result = read_result(out)
    assert (result["sync_offset_s"], result["sync_std_s"]) == (None, None)
    np.testing.assert_array_equal(read_fields(out / "fields.h5").abscissa, read_bundle(bundle).frame_time)


def test_images_identify_as_the_exact_fields_do(film, measured, both, tmp_path):
    config, known = tmp_path / "run.toml", tmp_path / "exact.h5"
    config.write_text("recentring_count = 0\ngrid = [0.85, 1.0, 1.15]\n")
    write_fields(known, replace(both[1], valid=both[0].valid, std=both[0].std))
    how = ("--engine", "equilibrium", "--config", config, "--workers", "1")
    shutil.copytree(measured, tmp_path / "images" / "dic")
    found = []
    for name, more in (("images", ()), ("exact", ("--fields", known))):
        done = run("identify", film, "-o", tmp_path / name, *how, *more)
        assert done.exit_code == 0, done.stderr
        assert ("28 of 28 images are kept" in done.stderr) == (name == "images")
        found.append(read_result(tmp_path / name))
        if name == "images":  # the same simulations
            shutil.copytree(tmp_path / "images" / "simulations", tmp_path / "exact" / "simulations")
    images, exact = (np.array(result["grid"]["objective"]) for result in found)
    assert [result["objective"] for result in found] == ["fields", "fields"]
    assert any("against the record" in remark for remark in found[0]["remarks"])  # clock and noise are told
    off, noise = (
        images - exact,
        1.8e-6 * 1.6,
    )  # m; deviation, and what the reference's share in all stations makes of it
    # noise beside a misfit Φ of the lattice adds 2σ²N ± 2σ√Φ, nearly the same at every node
    assert np.abs(off - 74 * 2 * 1.8e-6**2).max() < 4 * 2 * noise * np.sqrt(exact.max())
    field = read_arrays(tmp_path / "exact", IDENTIFY)["grid/displacement_m"]
    apart = np.sqrt(np.nansum((field - field[1, 1]) ** 2, axis=(2, 3, 4)))  # how much two nodes differ, m
    assert np.all(np.abs(off - off[1, 1]) <= 4 * 2 * noise * apart)  # four deviations


def test_the_gauge_finds_the_record_in_exact_fields(film):
    exact, curve = read_fields(film / "truth.h5"), read_bundle(film).curve
    seen, _ = opening(exact, np.array([-2e-3, 0.0]), np.array([2e-3, 0.0]), 5e-3)
    np.testing.assert_allclose(seen, curve.cmod_at(exact.abscissa), atol=2e-6)  # planes through bent flanks
