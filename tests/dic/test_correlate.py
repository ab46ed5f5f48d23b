"""Matching smooth motions: noise against the Cramér–Rao bound, invariance, large motion, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.dic.benchmark import bound
from pipeline.dic.camera import View
from pipeline.dic.correlate import Reference, correlate
from pipeline.dic.motion import Affine, Smooth
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Lens, photograph_pair, smooth_pair
from pipeline.dic.status import Status

QUIET = Camera(noise=0.0, bits=None)


@pytest.fixture(scope="module")
def smooth():
    return smooth_pair(400)


@pytest.fixture(scope="module")
def matched(smooth, one_core):
    return correlate(smooth.reference, smooth.deformed, one_core)


def test_noise_reaches_the_cramer_rao_bound(smooth, matched, one_core):
    off = matched.displacement - smooth.truth(matched.points)
    assert matched.valid.mean() > 0.999
    assert np.sqrt(np.nanmean(off**2)) < 1.1 * bound(smooth, one_core)  # the contract's goal


def test_the_stated_deviation_is_the_real_one(smooth, matched):
    pull = (matched.displacement - smooth.truth(matched.points)) / matched.std
    spread = 1.4826 * np.nanmedian(np.abs(pull))
    # subsets overlap: about 250 independent ones; noise in the gradients adds up to 10 %
    assert spread == pytest.approx(1.05, abs=0.15)


def test_there_is_no_bias(smooth, matched):
    off = matched.displacement - smooth.truth(matched.points)
    assert np.all(np.abs(np.nanmean(off, axis=0)) < 2e-3)  # 0.01 px / sqrt(250 subsets) = 6e-4, times three


def test_gradients_are_those_of_the_motion(smooth, matched):
    np.testing.assert_allclose(np.nanmean(matched.gradient, axis=0), [2e-3, 1e-3, -5e-4, -6e-4], atol=3e-4)
    # 0.01 px / 7.2 px / sqrt(250) = 9e-5, times three


def test_znssd_does_not_see_gain_and_offset(smooth, matched, one_core):
    brighter = correlate(smooth.reference, 0.6 * smooth.deformed.astype(float) + 40, one_core)
    both = matched.valid & brighter.valid
    np.testing.assert_allclose(brighter.warp[both, :2], matched.warp[both, :2], atol=2e-4)  # iterations stop at 1e-3
    np.testing.assert_allclose(brighter.level[both, 0], 0.6 * matched.level[both, 0], rtol=1e-3)  # as above


def test_the_number_of_threads_changes_nothing(smooth, matched):
    threads = correlate(smooth.reference, smooth.deformed, Settings(threads=3))
    np.testing.assert_array_equal(threads.warp, matched.warp)
    np.testing.assert_array_equal(threads.status, matched.status)


def test_whole_pixel_motion_without_noise_is_exact(one_core):
    pair = photograph_pair(Affine((7.0, -4.0)), (150, 150), 5, QUIET)
    found = correlate(pair.reference, pair.deformed, one_core)
    assert np.nanmax(np.abs(found.displacement - [7.0, -4.0])) < 1e-4  # no interpolation error at whole pixels
    assert np.nanmax(found.znssd[found.valid]) < 1e-8  # the grey values are the same


@pytest.mark.parametrize(("size", "model"), [(15, "affine"), (41, "affine"), (21, "rigid"), (21, "translation")])
def test_other_subsets_and_warps(size, model):
    shift = Affine.rigid((1.3, -0.6), 0.005 if model != "translation" else 0.0, (75, 75))
    pair = photograph_pair(shift, (150, 150), 2)
    settings = Settings(subset_size_px=size, model=model, threads=1)
    found = correlate(pair.reference, pair.deformed, settings)
    off = found.displacement - pair.truth(found.points)
    assert found.valid.mean() > 0.9
    limit = bound(pair, settings) * 1.45  # small subsets between the blobs scatter more than linearly
    assert np.sqrt(np.nanmean(off**2)) < limit


def test_rigid_warp_knows_rotation_from_strain():
    pair = photograph_pair(Affine.rigid((0.2, 0.1), 0.02, (75, 75)), (150, 150), 3, QUIET)
    found = correlate(pair.reference, pair.deformed, Settings(model="rigid", threads=1))
    expected = [np.cos(0.02) - 1, -np.sin(0.02), np.sin(0.02), np.cos(0.02) - 1]
    np.testing.assert_allclose(np.nanmedian(found.gradient, axis=0), expected, atol=2e-4)  # interpolation error


def test_sixty_pixels_and_two_hundredths_of_a_radian_at_once(one_core):
    pair = photograph_pair(Affine.rigid((60.0, -25.0), 0.02, (200, 200)), (400, 400), 7)
    found = correlate(pair.reference, pair.deformed, one_core)
    after = found.points + pair.truth(found.points)
    inside = np.all((after > 15) & (after < 384), axis=1)
    off = found.displacement - pair.truth(found.points)
    assert found.valid[inside].mean() > 0.995  # nothing is lost
    assert np.sqrt(np.nanmean(off**2)) < 0.0115  # as for small motions


def test_a_distorting_lens_is_seen_as_it_is(one_core):
    lens = Lens((100.0, 100.0), 140.0, 0.01)
    pair = photograph_pair(Affine((3.0, 1.0)), (200, 200), 4, replace(Camera(), lens=lens))
    found = correlate(pair.reference, pair.deformed, one_core)
    off = found.displacement - pair.truth(found.points)
    assert np.sqrt(np.nanmean(off**2)) < 0.0115  # noise only


def test_smooth_bends_are_low_pass_filtered_not_cut(one_core):
    wave = Smooth(lambda p: np.column_stack([np.zeros(len(p)), 0.5 * np.cos(2 * np.pi * p[:, 0] / 60)]))
    pair = photograph_pair(wave, (150, 200), 6)
    found = correlate(pair.reference, pair.deformed, Settings(grid_step_px=5, threads=1))
    assert found.split.mean() < 0.01  # no crack is invented
    assert found.valid.mean() > 0.95
    crest = np.abs(found.points[:, 0] % 60) < 1
    # second-order misfit of an affine fit: 0.5 (1 − (2π/60)² 12.5²/6) and higher terms; dic2_star5 shows 0.36 of 0.5
    assert np.nanmean(found.displacement[crest, 1]) == pytest.approx(0.36, abs=0.03)


def test_points_leaving_the_picture_say_so(one_core):
    pair = photograph_pair(Affine((40.0, 0.0)), (150, 150), 8)
    found = correlate(pair.reference, pair.deformed, one_core)
    gone = found.points[:, 0] > 150 - 40 + 13
    assert not found.valid[gone].any()
    assert (found.status[gone] == Status.OUTSIDE).mean() > 0.5  # the rest was never reached
    assert all(sentence.startswith(("ok", "split", "failed: ")) for sentence in found.reasons())


def test_region_of_interest_and_step():
    pair = photograph_pair(Affine((0.4, 0.2)), (150, 150), 9)
    found = correlate(pair.reference, pair.deformed, Settings(roi_px=(40, 50, 60, 30), grid_step_px=5, threads=1))
    assert found.points.min(axis=0).tolist() == [40, 50]
    assert found.points.max(axis=0).tolist() == [95, 75]


def test_specimen_coordinates(matched):
    view = View(0.05e-3, (200.0, 380.0))
    field = matched.field(view, 3.0)
    row = np.flatnonzero(matched.valid)[0]
    column, line = matched.points[row]
    np.testing.assert_allclose(field.points[row], [(column - 200) * 0.05e-3, -(line - 380) * 0.05e-3], rtol=1e-12)
    u, v = matched.displacement[row]
    np.testing.assert_allclose(field.displacement[0, row], [u * 0.05e-3, -v * 0.05e-3], rtol=1e-12)  # y points up
    assert field.abscissa.tolist() == [3.0]


def test_values_between_the_points(smooth, matched):
    between = np.random.default_rng(0).uniform(30, 370, (200, 2))
    moved, std, valid = matched.at(between)
    assert valid.all()
    assert (
        np.sqrt(np.mean((moved - smooth.truth(between)) ** 2)) < 0.013
    )  # 0.0103 at the points, 0.0013 × 3 px of their gradients
    assert np.all(std > 0)
    assert not matched.at(np.array([[-50.0, 0.0]]))[2].any()


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (np.zeros((150, 150)), "blank: every pixel has the grey value 0"),
        (np.full((150, 150), 255, np.uint8), "blank: every pixel has the grey value 255"),
        (np.indices((150, 150)).sum(axis=0) % 2 * 255, "2 different grey values"),
        (1e8 + np.random.default_rng(0).normal(size=(150, 150)), "single precision"),
        (1e15 * np.random.default_rng(0).normal(size=(150, 150)), "single precision"),
        (np.zeros((150, 150), complex), "type complex"),
        (np.zeros(150), "1 dimensions"),
        (np.zeros((150, 150, 3)), "3 dimensions"),
        (np.full((150, 150), "a"), "type"),
        (np.ones((8, 8)), "at least 16"),
        (np.where(np.eye(150) > 0, np.nan, 1.0), "not finite"),
        (np.random.default_rng(0).normal(size=(150, 140)), "one size"),
    ],
)
def test_unusable_pictures_get_one_clear_sentence(picture, message, one_core):
    good = photograph_pair(Affine(), (150, 150), 1).reference
    with pytest.raises(InputError, match=message):
        Reference(good, one_core).correlate(picture)


def test_unrelated_pictures_are_refused(one_core):
    first, second = (photograph_pair(Affine(), (150, 150), seed).reference for seed in (1, 2))
    with pytest.raises(ConvergenceError, match="points of the reference are found"):
        correlate(first, second, one_core)


def test_impossible_settings_are_all_named():
    with pytest.raises(InputError, match=r"subset_size_px .* 24; .*model .* 'quartic'"):
        Settings(subset_size_px=24, model="quartic")
    noise = np.random.default_rng(0).normal(size=(100, 100))
    with pytest.raises(InputError, match="reaches outside"):
        correlate(noise, noise, Settings(roi_px=(0, 0, 101, 50)))
