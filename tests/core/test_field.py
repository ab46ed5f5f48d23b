"""Displacement fields: interpolation between frames, rigid motion taken out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField, rigid_motion, rigid_residual

POINTS = np.array([(x, y) for x in (-9e-3, -4.5e-3, 4.5e-3, 9e-3) for y in (15e-3, 16.5e-3, 18e-3, 19.5e-3)])


def linear_in_time() -> DisplacementField:
    time = np.array([0.0, 1.0, 3.0])
    rate = np.random.default_rng(0).standard_normal((16, 2)) * 1e-6
    return DisplacementField(POINTS, time[:, None, None] * rate, np.ones((3, 16), bool), np.full((3, 16), 4e-7), time)


def test_linear_motion_is_interpolated_exactly():
    field = linear_in_time()
    at = field.at(np.array([0.25, 1.0, 2.9]))
    expected = np.array([0.25, 1.0, 2.9])[:, None, None] * field.displacement[1]
    np.testing.assert_allclose(at.displacement, expected, rtol=0, atol=1e-20)  # m; round-off of 1e-6 m
    assert at.valid.all()
    np.testing.assert_array_equal(at.abscissa, [0.25, 1.0, 2.9])


def test_noise_between_two_frames_is_averaged():
    std = linear_in_time().at(np.array([0.0, 0.5, 1.0])).std[:, 0]
    np.testing.assert_allclose(std, 4e-7 * np.array([1, np.sqrt(0.5), 1]), rtol=1e-12)  # two independent frames


def test_outside_the_frames_nothing_is_valid():
    assert not linear_in_time().at(np.array([-0.1, 3.1])).valid.any()


def test_an_invalid_frame_spoils_only_what_lies_beside_it():
    field = linear_in_time()
    field.valid[1, 4] = False
    valid = field.at(np.array([0.0, 0.5, 1.0, 2.0, 3.0])).valid
    np.testing.assert_array_equal(valid[:, 4], [True, False, False, False, True])
    assert valid[:, 5].all()


def test_shapes_are_checked():
    with pytest.raises(InputError, match="std of a displacement field has shape"):
        DisplacementField(POINTS, np.zeros((3, 16, 2)), np.ones((3, 16), bool), np.zeros(3), np.zeros(3))


@given(shift=st.tuples(*[st.floats(-1e-3, 1e-3)] * 2), angle=st.floats(-0.01, 0.01))
def test_any_small_rigid_motion_is_taken_out_whole(shift, angle):
    moved = np.array(shift) + angle * np.column_stack([-POINTS[:, 1], POINTS[:, 0]])
    left = rigid_residual(POINTS, moved[None], np.ones((1, 16), bool))
    assert np.abs(left).max() < 1e-17  # m; round-off of motions up to 1e-3 m


def test_the_residual_has_no_mean_and_no_moment():
    noise = np.random.default_rng(1).standard_normal((5, 16, 2))
    left = rigid_residual(POINTS, noise, np.ones((5, 16), bool))
    arm = POINTS - POINTS.mean(axis=0)
    assert np.abs(left.mean(axis=1)).max() < 1e-15  # round-off of numbers of order one
    assert np.abs(np.sum(arm[:, 0] * left[..., 1] - arm[:, 1] * left[..., 0], axis=1)).max() < 1e-15  # the same
    np.testing.assert_allclose(rigid_residual(POINTS, left, np.ones((5, 16), bool)), left, atol=1e-15)  # a projection


def test_invalid_points_do_not_carry_the_fit():
    moved = np.full((1, 16, 2), 1e-5)
    moved[0, 3] = 1.0
    valid = np.ones((1, 16), bool)
    valid[0, 3] = False
    left = rigid_residual(POINTS, moved, valid)
    assert np.abs(left[valid]).max() < 1e-18  # m; round-off of 1e-5 m
    assert left[0, 3] == pytest.approx([1.0, 1.0], abs=1e-4)


def test_opening_of_the_crack_survives():
    opening = np.where(POINTS[:, :1] > 0, [[1e-5, 0]], [[-1e-5, 0]])
    left = rigid_residual(POINTS, opening[None], np.ones((1, 16), bool))[0]
    np.testing.assert_allclose(left, opening, rtol=0, atol=1e-20)  # m; symmetric opening is orthogonal to rigid motion


def test_rigid_motion_of_two_points_is_theirs():
    at, moved = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 0.0], [0.0, 0.1]])
    np.testing.assert_allclose(rigid_motion(at, moved, np.ones(2, bool)), moved, atol=1e-16)  # rotation by 0.1
