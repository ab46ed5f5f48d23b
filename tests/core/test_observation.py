"""Observation: exact on affine flanks, split at the crack, honest about voids."""

from __future__ import annotations

import time

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.observation import observe, stations
from pipeline.core.particles import Bonds, Particles

R = 0.3e-3
ROUND_OFF = 1e-15  # m; displacements below are 1e-5 m, weights of order one, 40 terms


def patch(width: float = 24e-3, height: float = 12e-3, keep=None, tilt: float = 0.0) -> tuple[Particles, Bonds]:
    """Triangular lattice with rows along y, x from −width/2, y from 0; bonds between nearest neighbours."""
    columns, rows = int(width / (np.sqrt(3) * R)), int(height / (2 * R))
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    at = np.column_stack([(i * np.sqrt(3) * R).ravel() - width / 2, ((j + (i % 2) / 2) * 2 * R).ravel()])
    at = at @ np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]])
    at = at if keep is None else at[keep(at)]
    gap = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    pairs = np.argwhere(np.triu(gap < 2.1 * R, 1)).astype(np.int32)
    n, m = len(at), len(pairs)
    return (
        Particles(at, R, np.ones(n, np.uint8), np.zeros(n, np.int32)),
        Bonds(pairs, np.ones(m, np.uint8), np.zeros(m, bool)),
    )


@pytest.fixture(scope="module")
def lattice() -> tuple[Particles, Bonds]:
    return patch()


POINTS = np.array([(x, y) for x in (-9e-3, -4.5e-3, -0.4e-3, 0.4e-3, 4.5e-3, 9e-3) for y in (3e-3, 4.5e-3, 6e-3)])


def test_affine_fields_are_exact(lattice):
    particles, bonds = lattice
    gradient, shift = np.array([[1e-3, -2e-3], [5e-4, 7e-4]]), np.array([3e-6, -1e-6])
    field = np.stack([s * (particles.position @ gradient.T + shift) for s in (0.0, 0.5, 1.0)])
    values, valid = observe(particles, bonds, field, POINTS, np.full(bonds.count, 1e-5))
    assert valid.all()
    expected = np.array([0.0, 0.5, 1.0])[:, None, None] * (POINTS @ gradient.T + shift)
    np.testing.assert_allclose(values, expected, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("tilt", [0.0, np.pi / 2, 0.3])
def test_each_flank_of_a_crack_keeps_its_own_motion(tilt):
    particles, bonds = patch(16e-3, 16e-3, tilt=tilt)
    points = np.array([(x, y) for x in (-2e-3, -1e-3, -0.5e-3, 0.5e-3, 1e-3, 2e-3) for y in (6e-3, 7e-3)])
    points = points @ np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]])
    normal = np.array([np.cos(tilt), np.sin(tilt)])

    def motion(at: np.ndarray) -> np.ndarray:
        right = at @ normal > 0
        turned = np.column_stack([-at[:, 1], at[:, 0]])
        return np.where(right[:, None], 30e-6 * normal - 1e-3 * turned, 2e-3 * turned)

    values, valid = observe(particles, bonds, motion(particles.position)[None], points, np.full(bonds.count, 5e-6))
    assert valid.all()
    np.testing.assert_allclose(values[0], motion(points), rtol=0, atol=ROUND_OFF)
    blind, _ = observe(particles, bonds, motion(particles.position)[None], points, np.full(bonds.count, 1.0))
    assert np.abs(blind[0] - motion(points)).max() > 5e-6  # without cutting, a point near the crack mixes both flanks


def test_faces_that_slide_are_apart(lattice):
    particles, bonds = lattice
    slid = np.where(particles.position[:, :1] > 0, [[0.0, 4e-5]], 0.0)[None]
    values, _ = observe(particles, bonds, slid, POINTS, np.full(bonds.count, 1e-5))
    expected = np.where(POINTS[:, :1] > 0, [[0.0, 4e-5]], 0.0)
    np.testing.assert_allclose(values[0], expected, rtol=0, atol=ROUND_OFF)


def test_a_crack_that_closes_joins_again(lattice):
    particles, bonds = lattice
    open_field = np.where(particles.position[:, :1] > 0, [[2e-5, 0.0]], 0.0)
    field = np.stack([0 * open_field, open_field, 0 * open_field])
    values, _ = observe(particles, bonds, field, POINTS, np.full(bonds.count, 1e-5))
    np.testing.assert_array_equal(values[0], values[2])
    np.testing.assert_allclose(values[1][POINTS[:, 0] > 0], [[2e-5, 0.0]] * 9, rtol=0, atol=ROUND_OFF)


def test_flanks_of_another_field(lattice):
    """Half a crack that one field has opened and the other not yet: read over the same material they differ little."""
    particles, bonds = lattice
    right = (particles.position[:, :1] > 0) * np.array([1.0, 0.0])
    parted, before = (opening * right[None] for opening in (1.2e-5, 1.1e-5))  # bonds across lie at 30°
    open_at, points = np.full(bonds.count, 1e-5), np.array([(0.5e-3, 6e-3)])
    (there, _), (own, _) = (observe(particles, bonds, field, points, open_at) for field in (parted, before))
    same, valid = observe(particles, bonds, before, points, open_at, joined_as_in=parted)
    assert valid.all()
    np.testing.assert_allclose(same[0, 0], [1.1e-5, 0], rtol=0, atol=ROUND_OFF)
    assert np.abs(there - same).max() == pytest.approx(0.1e-5, rel=1e-9)  # round-off
    assert np.abs(there - own).max() > 1e-6, "over its own it is a mean of both flanks"


def test_rotation_of_the_whole_cuts_nothing(lattice):
    particles, bonds = lattice
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) - np.eye(2)
    values, valid = observe(particles, bonds, (particles.position @ turn.T)[None], POINTS, np.full(bonds.count, 1e-9))
    assert valid.all()
    np.testing.assert_allclose(values[0], POINTS @ turn.T, rtol=0, atol=1e-16)  # m; round-off of 3 mm displacements


def test_quadratic_field_error_is_second_order_in_reach(lattice):
    particles, bonds = lattice
    field = (particles.position**2)[None]
    centre = np.array([[0.1e-3, 6e-3]])
    errors = [
        np.abs(observe(particles, bonds, field, centre, np.full(bonds.count, 1.0), reach)[0][0] - centre**2).max()
        for reach in (2e-3, 4e-3)
    ]
    assert errors[1] / errors[0] == pytest.approx(
        4, rel=0.1
    )  # the plane misses curvature × reach²; lattice sums differ


def test_points_in_voids_and_outside_are_invalid():
    particles, bonds = patch(keep=lambda at: np.hypot(at[:, 0], at[:, 1] - 6e-3) > 1.2e-3)
    points = np.array([(0.0, 6e-3), (0.9e-3, 6e-3), (3e-3, 6e-3), (0.0, -2e-3), (50e-3, 6e-3)])
    values, valid = observe(particles, bonds, np.ones((1, particles.count, 2)), points, np.full(bonds.count, 1.0))
    np.testing.assert_array_equal(valid[0], [False, True, True, False, False])
    np.testing.assert_array_equal(np.isnan(values[0, :, 0]), ~valid[0])
    np.testing.assert_allclose(values[0, valid[0]], 1.0, rtol=1e-12)  # weights sum to one; 40 terms


def test_a_crumb_that_carries_no_plane_is_invalid(lattice):
    particles, bonds = lattice
    one = int(np.argmin(np.hypot(*(particles.position - (0, 6e-3)).T)))
    swollen = 1e-3 * (particles.position - particles.position[one])
    field = np.stack([0 * swollen, swollen])
    _, valid = observe(particles, bonds, field, particles.position[[one]], np.full(bonds.count, 1e-8))
    np.testing.assert_array_equal(valid[:, 0], [True, False])


def test_translating_everything_translates_the_answer(lattice):
    particles, bonds = lattice
    rng = np.random.default_rng(0)
    field = 1e-6 * rng.standard_normal((1, particles.count, 2))
    limit = np.full(bonds.count, 1e-3)
    shift = np.array([0.013, -0.7])
    here, _ = observe(particles, bonds, field, POINTS, limit)
    there = Particles(particles.position + shift, R, particles.phase, particles.stone)
    moved, _ = observe(there, bonds, field, POINTS + shift, limit)
    np.testing.assert_allclose(
        moved, here, rtol=0, atol=1e-6 * 1e-10
    )  # positions of 0.7 m carry 1e-16 / 1e-3 of the reach


def test_sixteen_points_at_ten_stations_cost_nothing(lattice):
    particles, bonds = lattice
    field = np.zeros((10, particles.count, 2))
    begin = time.process_time()
    observe(particles, bonds, field, POINTS[:16], np.full(bonds.count, 1e-5))
    assert time.process_time() - begin < 0.1  # measured 0.006 s; a loop over bonds in Python would take seconds


def test_no_points_give_empty_answers(lattice):
    particles, bonds = lattice
    values, valid = observe(
        particles, bonds, np.zeros((2, particles.count, 2)), np.zeros((0, 2)), np.full(bonds.count, 1.0)
    )
    assert values.shape == (2, 0, 2)
    assert valid.shape == (2, 0)


def test_stations_start_at_the_parabola_peak():
    cmod = np.linspace(0, 0.6e-3, 601)
    curve = LoadCurve(cmod, cmod, 1000 - 1e12 * (cmod - 0.0503e-3) ** 2)
    expected = 0.0503e-3 + 0.05e-3 * np.arange(10)
    np.testing.assert_allclose(stations(curve, 10, 0.05e-3), expected, rtol=0, atol=1e-12)  # m; exact for a parabola


@pytest.mark.parametrize(("count", "step"), [(0, 1e-5), (3, 0.0), (3, -1e-5), (3, float("nan"))])
def test_stations_refuse_nonsense(count, step):
    with pytest.raises(InputError, match="stations"):
        stations(LoadCurve(np.arange(3.0), np.arange(3.0), np.array([0, 1.0, 0])), count, step)
