"""Where the camera of a virtual test stands, and that what it photographs is what is told as truth."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.bundles import coarse_experiment

from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam
from pipeline.core.units import MM
from pipeline.dic.correlate import correlate
from pipeline.dic.settings import Settings
from pipeline.store.bundle import read_bundle
from pipeline.store.new import Contents, write_bundle
from pipeline.store.sections import PixelFrame
from pipeline.study.assembly import build_model
from pipeline.study.filming import LATEST, draw_clock
from pipeline.study.photography import Film, Sheet, camera_frame, view_of

BEAM = SingleEdgeNotchedBeam(60 * MM, 130 * MM, 137 * MM, 40 * MM, 15 * MM)
DISK = DiskCompactTension(150 * MM, 110 * MM, 35 * MM, 50 * MM, 27.5 * MM)
SMALL = SingleEdgeNotchedBeam(20 * MM, 30 * MM, 34 * MM, 10 * MM, 4 * MM)


@pytest.mark.parametrize("pitch", [0.0439, 0.12])
def test_the_paper_is_the_default_view(pitch):
    (rows, columns), frame = camera_frame(BEAM, pitch)
    assert (rows, columns) == (round(44 / pitch), round(57 / pitch))  # 1300 × 1000 at 0.0439
    view = view_of(frame)
    np.testing.assert_allclose(view.pixel(np.zeros((1, 2)))[0], [(columns - 1) / 2, rows - 1 - 10])  # the mouth
    tip = view.pixel(np.array([BEAM.tip]))[0]
    assert 0 < tip[1] < rows - 11


@pytest.mark.parametrize("specimen", [BEAM, DISK, SMALL])
def test_notch_tip_and_ligament_are_in_the_picture(specimen):
    (rows, columns), frame = camera_frame(specimen, 0.1)
    tip = view_of(frame).pixel(np.array([specimen.tip]))[0]
    assert 30 < tip[0] < columns - 30
    assert 30 < tip[1] < rows - 30
    x0, y0, x1, y1 = specimen.bounds
    assert columns <= round((x1 - x0) / 0.1 / MM)
    assert rows <= round((y1 - y0) / 0.1 / MM)


def test_a_view_is_that_of_the_settings():
    frame = PixelFrame(mm_per_px=0.05, origin_px=(100.0, 200.0), rotation_deg=90.0, mirror=True)
    view = view_of(frame)
    np.testing.assert_allclose(view.point(np.array([[110.0, 200.0]])), [[0.0, 0.5 * MM]], atol=1e-12)  # turned
    np.testing.assert_allclose(view.point(np.array([[100.0, 190.0]])), [[0.5 * MM, 0.0]], atol=1e-12)  # and mirrored


def test_clocks_are_drawn_and_differ():
    drawn = [draw_clock(np.random.default_rng(seed)) for seed in range(40)]
    late = np.array([clock.offset for clock in drawn])
    assert np.abs(late).max() <= LATEST
    assert late.std() == pytest.approx(LATEST / np.sqrt(3), rel=0.35)  # uniform; three deviations of one of 40
    assert all(0 <= clock.phase <= 1 for clock in drawn)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bundles") / "b"
    write_bundle(folder, coarse_experiment("b"), Contents())
    problem = build_model(read_bundle(folder)).problem(1.0, 1e-3, frames=np.array([1e-5]), cmod_max=1e-4)
    (rows, columns), frame = camera_frame(problem.specimen, 0.25)
    x, y = problem.particles.position.T
    field = np.column_stack([2e-3 * x + 5e-4 * y, -1e-3 * y + 3e-5])
    return Film(Sheet(problem, view_of(frame)), (rows, columns), field[None], 1, 0.0)


def test_truth_is_what_the_pictures_show(film):
    settings = Settings(grid_step_px=10, threads=1, split=False)
    points, frames = film.truth(settings)
    told = [moved for moved, _, _ in frames]
    np.testing.assert_array_equal(told[0], 0)
    x, y = points.T
    inner = (np.abs(x) > 5 * MM) & (y > 5 * MM)  # clear of the notch
    expected = np.column_stack([2e-3 * x + 5e-4 * y, -1e-3 * y + 3e-5])
    np.testing.assert_allclose(told[1][inner], expected[inner], atol=1e-10)  # affine, so exact on every triangle
    still, moved = film.pictures(np.random.default_rng(0))
    found = correlate(still, moved, settings)
    seen, _, valid = found.at(film.sheet.view.pixel(points))
    off = (film.sheet.view.vector(seen) - told[1])[valid & inner]
    assert valid[inner].mean() > 0.95
    assert np.sqrt(np.mean(off**2)) < 0.02 * 0.25 * MM  # 8 bits and flicker, no noise


def test_two_films_of_one_seed_are_one(film):
    one, two = (list(film.pictures(np.random.default_rng(5))) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert np.any(one[0] != next(film.pictures(np.random.default_rng(6))))
