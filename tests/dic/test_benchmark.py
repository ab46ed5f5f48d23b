"""The judge of the correlation is judged here."""

import numpy as np
import pytest

from pipeline.dic.benchmark import Row, bound, count
from pipeline.dic.correlate import correlate
from pipeline.dic.motion import Affine
from pipeline.dic.scenes import random_scene
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Pair, Speckle, photograph_pair, smooth_pair


def test_the_bound_of_one_blob_is_the_integral_of_its_slope():
    speckle = Speckle(np.array([[20.0, 20.0, 2.0, 100.0]]))
    camera = Camera(noise=2.0)
    pair = photograph_pair(Affine(), (41, 41), 0, camera, speckle=speckle)
    # Σ (∂f/∂x)² over the whole blob is π A²/2; central differences damp it by 1 − 1/(2·3·σ²) squared
    limit = bound(pair, Settings(subset_size_px=39, threads=1))
    exact = np.sqrt(2 * (4 + 1 / 12) / (np.pi * 100**2 / 2))
    assert limit == pytest.approx(exact, rel=0.15)  # the damping of central differences at σ = 2 px
    assert limit > exact


def test_wrong_points_are_counted():
    pair = smooth_pair(120)
    found = correlate(pair.reference, pair.deformed, Settings(threads=1))
    assert count(found, pair).wrong.tolist() == [0, 0]
    shifted = Pair(pair.reference, pair.deformed, Affine((5.0, 0.0)), pair.speckle, pair.camera)
    assert count(found, shifted).wrong.tolist() == [0, int(found.valid.sum())]


def test_scenes_are_drawn_from_their_seed_alone():
    first, again, other = (random_scene(seed, 120).pair.deformed for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


@pytest.mark.parametrize("seed", range(6))
def test_scenes_bend_too_little_to_trouble_an_affine_subset(seed):
    motion = random_scene(seed, 120).pair.motion
    at = np.array([[60.0, 60.0]])
    for cut in motion.cuts:
        along = np.array([np.cos(cut.angle), np.sin(cut.angle)])
        line = at + np.arange(-300, 300)[:, None] * along
        second = np.abs(np.diff(cut.opened(line), 2, axis=0)).max()
        assert second < 4.2e-4  # the declared 4e-4, and its finite difference


def test_a_row_says_whether_its_goal_is_met():
    assert "MISSED" in str(Row("x", 2.0, "≤ 1", False))
    assert str(Row("x", 2.0, "≤ 3", True)).endswith("met")
