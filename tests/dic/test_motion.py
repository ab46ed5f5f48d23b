"""Known motions and their inverse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.dic.motion import Affine, Cracked, Cut, Smooth, origin_of, truth

small = st.floats(-0.02, 0.02)
points = np.random.default_rng(0).uniform(0, 200, (300, 2))


@given(st.floats(-30, 30), st.floats(-30, 30), small, small, small, small)
def test_inverse_of_an_affine_motion_returns_the_material_point(u, v, a, b, c, d):
    motion = Affine((u, v), ((a, b), (c, d)), (100.0, 100.0))
    origin, seen = origin_of(motion, points + truth(motion, points))
    assert seen.all()
    np.testing.assert_allclose(origin, points, atol=1e-8)  # the fixed point stops at 1e-10 px


def test_rigid_motion_keeps_distances():
    motion = Affine.rigid((60.0, -25.0), 0.02, (50.0, 60.0))
    moved = points + truth(motion, points)
    before, after = (np.linalg.norm(p - p[0], axis=1) for p in (points, moved))
    np.testing.assert_allclose(after, before, rtol=1e-12)  # round-off


def test_magnification_scales_about_its_centre():
    motion = Affine.magnified(1.01, (10.0, 20.0))
    np.testing.assert_allclose(truth(motion, np.array([[110.0, 20.0]])), [[1.0, 0.0]], atol=1e-12)  # round-off


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, 4.0])
def test_the_two_sides_part_by_the_jump_and_the_gap_shows_nothing(angle):
    cut = Cut((100.0, 100.0), angle, (6.0, 1.0), lambda xi: np.ones_like(xi))
    motion = Cracked((cut,))
    along, normal = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    at = np.array([100.0, 100.0]) + 30 * along
    above, below = truth(motion, np.array([at + 1e-6 * normal, at - 1e-6 * normal]))
    np.testing.assert_allclose(above - below, 6 * normal + along, atol=1e-9)  # definition of the jump
    _, seen = origin_of(motion, at + np.array([[0.0], [2.9], [-2.9], [3.1], [-3.1]]) * normal)
    assert seen.tolist() == [False, False, False, True, True]  # the gap is 6 px wide


def test_inverse_of_a_cracked_motion_keeps_every_point_on_its_own_side():
    cut = Cut((60.0, 80.0), 0.4, (3.0, 0.5), lambda xi: xi / 100, lambda xi: 4 * np.sin(xi / 30))
    motion = Cracked((cut,), Affine((1.0, 2.0), ((1e-3, 0), (0, -1e-3))))
    origin, seen = origin_of(motion, points + truth(motion, points))
    off = np.linalg.norm(origin - points, axis=1)
    assert seen.all()
    assert np.mean(off < 1e-8) > 0.97  # sliding over a wave overlaps: there another point may lie on top


def test_distance_is_measured_to_the_cracked_part_only():
    cut = Cut((50.0, 50.0), 0.0, (1.0, 0.0), np.ones_like)
    distance = cut.distance(np.array([[60.0, 53.0], [40.0, 50.0]]))
    np.testing.assert_allclose(distance, [3.0, 10.0], atol=0.05)  # the trace is sampled every 0.5 px


def test_smooth_takes_any_function():
    motion = Smooth(lambda p: 0.5 * np.column_stack([np.sin(p[:, 1] / 20), np.cos(p[:, 0] / 20)]))
    origin, _ = origin_of(motion, points + truth(motion, points))
    np.testing.assert_allclose(origin, points, atol=1e-8)  # the fixed point stops at 1e-10 px
