"""Photographs with a known answer."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.dic.motion import Affine, Cracked, Cut
from pipeline.dic.speckle import Camera, Lens, Speckle, expose, photograph, photograph_pair

QUIET = Camera(noise=0.0, bits=None)


def test_one_blob_is_a_gaussian():
    speckle = Speckle(np.array([[20.0, 30.0, 1.7, 80.0]]), background=10.0)
    at = np.array([[20.0, 30.0], [21.5, 29.0], [20.0, 45.0]])
    expected = 10 + 80 * np.exp(-np.sum((at - [20, 30]) ** 2, axis=1) / (2 * 1.7**2))
    np.testing.assert_allclose(speckle.grey(at), expected, atol=80 * 4e-6)  # blobs are cut off at 5 sigma


def test_blobs_add_up_whatever_their_order():
    random = np.random.default_rng(3)
    speckle = Speckle.scattered((60, 80), random)
    at = random.uniform(0, 60, (500, 2))
    d2 = np.sum((at[:, None] - speckle.blobs[None, :, :2]) ** 2, axis=2)
    direct = (speckle.blobs[:, 3] * np.exp(-d2 / (2 * speckle.blobs[:, 2] ** 2))).sum(axis=1) + speckle.background
    np.testing.assert_allclose(speckle.grey(at, threads=2), direct, atol=0.01)  # tails beyond 5 sigma of ~ 100 blobs


def test_a_photograph_of_a_motion_is_the_pattern_at_the_material_points():
    speckle = Speckle.scattered((40, 50), np.random.default_rng(0))
    motion = Affine((3.2, -1.1), ((0.01, 0), (0, -0.01)), (20, 20))
    moved = expose(speckle, (40, 50), motion, QUIET)
    assert moved[18:30, 10:30].std() > 5  # there is something to see
    back = np.linalg.solve(np.diag([1.01, 0.99]), np.array([24 - 3.2 - 20, 19 + 1.1 - 20])) + 20
    assert moved[19, 24] == pytest.approx(float(speckle.grey(back[None])[0]), abs=1e-4)  # single precision


def test_noise_gain_and_offset_are_those_of_the_camera():
    speckle = Speckle(np.array([[1e3, 1e3, 1.0, 1.0]]), background=100.0)
    seen = photograph(speckle, (300, 300), Affine(), Camera(3.0, 0.5, 20.0), np.random.default_rng(1))
    assert seen.mean() == pytest.approx(70.0, abs=0.04)  # 0.5 × 100 + 20; four deviations of the mean of 90,000
    assert seen.std() == pytest.approx(np.hypot(3.0, np.sqrt(1 / 12)), rel=0.01)  # rounding adds 1/12


def test_sixteen_bits_keep_what_eight_cut():
    speckle = Speckle(np.array([[10.0, 10.0, 2.0, 4000.0]]))
    deep = photograph(speckle, (20, 20), Affine(), Camera(0.0, bits=16), np.random.default_rng(0))
    flat = photograph(speckle, (20, 20), Affine(), Camera(0.0), np.random.default_rng(0))
    assert deep.dtype == np.uint16
    assert deep.max() == 4000
    assert flat.max() == 255


def test_the_gap_is_dark_and_as_wide_as_the_opening():
    speckle = Speckle(np.array([[1e3, 1e3, 1.0, 1.0]]), background=60.0)
    motion = Cracked((Cut((29.7, -500.0), np.pi / 2, (8.0, 0.0), np.ones_like),))
    seen = expose(speckle, (60, 60), motion, replace(QUIET, fill=8))
    dark = (60 - seen) / (60 - QUIET.gap)  # share of each pixel that lies in the gap
    np.testing.assert_allclose(dark.sum(axis=1), 8.0, atol=0.13)  # eight samples a pixel


def test_blur_widens_blobs_like_a_convolution_of_gaussians():
    speckle = Speckle(np.array([[20.0, 20.0, 1.5, 100.0]]))
    seen = expose(speckle, (41, 41), Affine(), replace(QUIET, blur=2.0))
    width2 = 1.5**2 + 2.0**2
    at = np.mgrid[:41, :41] - 20.0
    expected = 100 * 1.5**2 / width2 * np.exp(-np.sum(at**2, axis=0) / (2 * width2))
    np.testing.assert_allclose(seen, expected, atol=0.02)  # the filter is cut off at 4 sigma


@given(st.floats(-0.02, 0.02), st.floats(0, 400), st.floats(0, 300))
def test_straightening_undoes_distortion(strength, column, row):
    lens = Lens((200.0, 150.0), 250.0, strength)
    point = np.array([[column, row]])
    np.testing.assert_allclose(lens.straighten(lens.distort(point)), point, atol=1e-9)  # Newton to round-off


def test_the_truth_of_a_distorted_pair_includes_the_lens():
    lens = Lens((50.0, 50.0), 70.0, 0.02)
    pair = photograph_pair(Affine((5.0, 0.0)), (100, 100), 1, replace(QUIET, lens=lens))
    moved = pair.truth(np.array([[50.0, 50.0], [90.0, 50.0]]))
    assert moved[0, 0] == pytest.approx(5 + 5 * 0.02 * 25 / 4900, abs=1e-9)  # x(1 + k r²/R²) at 5 px from the centre
    assert moved[1, 0] > moved[0, 0]  # farther out the picture is stretched


def test_impossible_cameras_are_refused():
    with pytest.raises(InputError, match="noise -1"):
        Camera(noise=-1.0)
