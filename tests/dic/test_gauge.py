"""The opening across the notch."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField
from pipeline.dic.gauge import opening, rigid_opening

X, Y = np.meshgrid(np.linspace(-10e-3, 10e-3, 41), np.linspace(0, 10e-3, 21))
POINTS = np.column_stack([X.ravel(), Y.ravel()])


def field(noise=0.0, seed=0):
    moved = []
    for step in (0.0, 20e-6, 50e-6):
        side = np.sign(POINTS[:, :1])
        moved.append(side * [[step / 2, 0]] + POINTS * [1e-3, -2e-4] + [3e-6, 0])
    moved = np.array(moved) + np.random.default_rng(seed).normal(0, noise, (3, len(POINTS), 2))
    ok = np.ones((3, len(POINTS)), bool)
    return DisplacementField(POINTS, moved, ok, np.full(ok.shape, noise), np.arange(3.0))


def test_jump_and_stretch_between_the_feet():
    seen, _ = opening(field(), np.array([-2e-3, 1e-3]), np.array([2e-3, 1e-3]), 2e-3)
    np.testing.assert_allclose(seen, np.array([0, 20e-6, 50e-6]) + 4e-6, rtol=1e-9)  # 4 mm stretched by 1e-3


def test_its_deviation_is_the_scatter():
    feet = (np.array([-2e-3, 5e-3]), np.array([2e-3, 5e-3]), 1.5e-3)
    draws = np.array([opening(field(1e-6, seed), *feet)[0] for seed in range(200)])
    stated = opening(field(1e-6), *feet)[1]
    np.testing.assert_allclose(draws.std(axis=0), stated, rtol=0.2)  # four deviations of a deviation of 200


def test_subsets_that_overlap_err_together():
    """Noise of one value a cell of 2 mm, as if subsets shared it, read at points 0.5 mm apart."""
    feet, edge, noise = (np.array([-4e-3, 5e-3]), np.array([4e-3, 5e-3]), 3e-3), 2e-3, 1e-6
    random, draws = np.random.default_rng(0), []
    flat = field(noise)
    for _ in range(300):
        white = random.normal(0, 1, (3, 60, 100))
        smooth = uniform_filter(white, (0, 4, 4))[:, 20:41, 20:61] * 4  # 4 × 4 steps of 0.5 mm: squares that overlap
        moved = np.zeros_like(flat.displacement)
        moved[..., 0] = noise * smooth.reshape(3, -1)
        draws.append(opening(replace(flat, displacement=moved), *feet)[0])
    stated = opening(flat, *feet, shared=edge)[1]
    np.testing.assert_allclose(np.std(draws, axis=0), stated, rtol=0.15)  # three deviations of a deviation of 300
    assert np.all(opening(flat, *feet)[1] < 0.6 * stated)  # as if each were on its own: too good by far


def turned(noise=0.0, seed=0, by=2e-4):
    """Two arms that turn about (0, 40) mm, as the halves of a specimen do, with some motion of the whole."""
    moved = []
    for angle in (0.0, by):
        side = np.sign(POINTS[:, 0])[:, None] * angle
        arm = POINTS - [0.0, 40e-3]
        moved.append(np.column_stack([-arm[:, 1], arm[:, 0]]) * side + [3e-6, -8e-6])
    moved = np.array(moved) + np.random.default_rng(seed).normal(0, noise, (2, len(POINTS), 2))
    ok = np.ones((2, len(POINTS)), bool)
    return DisplacementField(POINTS, moved, ok, np.full(ok.shape, noise), np.arange(2.0))


ARMS = POINTS[:, 0] < -1e-3, POINTS[:, 0] > 1e-3
FAR_FEET = np.array([-2e-3, -30e-3]), np.array([2e-3, -30e-3])


def test_a_gauge_out_of_sight_is_carried_by_the_arms():
    seen, _ = rigid_opening(turned(), *FAR_FEET, ARMS, 0.0)
    np.testing.assert_allclose(seen, [0, 2 * 2e-4 * 70e-3], atol=1e-15)  # both turn, 70 mm from the hinge


def test_the_deviation_of_a_carried_gauge_is_its_scatter():
    draws = np.array([rigid_opening(turned(1e-6, seed), *FAR_FEET, ARMS, 0.0)[0] for seed in range(200)])
    stated = rigid_opening(turned(1e-6), *FAR_FEET, ARMS, 0.0)[1]
    np.testing.assert_allclose(draws.std(axis=0), stated, rtol=0.2)  # four deviations of a deviation of 200


def test_an_arm_without_points_has_no_opening():
    field = turned()
    none = replace(field, valid=field.valid & (POINTS[:, 0] > 0))
    assert np.isnan(rigid_opening(none, *FAR_FEET, ARMS, 0.0)[0]).all()


def test_a_foot_off_the_picture_is_refused():
    with pytest.raises(InputError, match="gauge foot"):
        opening(field(), np.array([-30e-3, 0.0]), np.array([2e-3, 0.0]), 1e-3)
