"""Simulated fields seen through the camera."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from pipeline.core.errors import InputError
from pipeline.dic.camera import View
from pipeline.dic.level import Levelling, Mesh
from pipeline.dic.settings import Settings

PITCH, SCALE = 0.6e-3, 0.0439e-3  # m; particles of 0.3 mm, m/px
POINTS = np.array(
    [(i * PITCH + (j % 2) * PITCH / 2, j * PITCH * np.sqrt(3) / 2) for j in range(-1, 17) for i in range(-1, 15)]
)
VIEW = View(SCALE, (0.0, 179.0))
SPLIT_AT = 4.05e-3  # between two columns of particles


def opened(points, by):
    side = np.where(points[:, 0] > SPLIT_AT, 0.5, -0.5)
    return np.column_stack([side * by + 1e-3 * points[:, 0], -5e-4 * points[:, 1]])


def torn(points):
    corner = Delaunay(points).simplices
    edges = np.unique(np.sort(np.vstack([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), axis=1), axis=0)
    far = points[:, 0] > SPLIT_AT
    return edges[far[edges[:, 0]] != far[edges[:, 1]]]


@pytest.fixture(scope="module")
def levelled():
    levelling = Levelling((180, 180), VIEW, Settings(threads=1, grid_step_px=8))
    broken = torn(POINTS)
    moves = np.array([opened(POINTS, 0.0), opened(POINTS, 0.2e-3)])
    return levelling.correlations(POINTS, moves, [None, broken])


def test_an_affine_field_comes_back_as_it_is(levelled):
    whole = levelled[0]
    point = VIEW.point(whole.points)
    off = VIEW.vector(whole.displacement) - opened(point, 0.0)
    assert whole.valid.mean() > 0.95
    assert np.sqrt(np.nanmean(off**2)) < 0.01 * SCALE  # what interpolation without noise leaves over, 0.005 px


def test_a_crack_comes_back_with_its_opening(levelled):
    cracked = levelled[1]
    point = VIEW.point(cracked.points)
    off = VIEW.vector(cracked.displacement) - opened(point, 0.2e-3)
    away = np.abs(point[:, 0] - SPLIT_AT) > PITCH + 13 * SCALE  # the crack winds between the particles
    assert cracked.valid[away].mean() > 0.95
    assert np.sqrt(np.nanmean(off[away] ** 2)) < 0.015 * SCALE  # as above, beside split subsets
    assert cracked.split.sum() > 10
    assert np.nanmedian(np.abs(cracked.opening[cracked.split])) * SCALE == pytest.approx(0.2e-3, rel=0.15)  # it winds


def test_values_at_chosen_points():
    levelling = Levelling((180, 180), VIEW, Settings(threads=1, grid_step_px=12))
    at = np.array([[1.5e-3, 4e-3], [6.5e-3, 4e-3]])
    field = levelling.field_at(at, POINTS, np.array([opened(POINTS, 0.2e-3)]), np.array([0.3]), [torn(POINTS)])
    assert field.valid.all()
    np.testing.assert_allclose(field.displacement[0], opened(at, 0.2e-3), atol=0.02 * SCALE)  # as above
    assert field.abscissa.tolist() == [0.3]


def test_the_mesh_shows_each_material_point_once_and_nothing_in_the_gap():
    mesh = Mesh(VIEW.pixel(POINTS))
    moved = mesh.moved(VIEW.pixel_vector(opened(POINTS, 0.5e-3)), torn(POINTS))
    axis = np.arange(180.0)
    origin, seen = moved.origin_on(axis, axis)
    gap = (~seen).reshape(180, 180)[20:160].sum(axis=1)
    assert gap.mean() == pytest.approx(0.5e-3 / SCALE, abs=1.0)  # 11.4 px wide, on a raster
    whole = mesh.moved(np.zeros((len(POINTS), 2)))
    still, all_seen = whole.origin_on(axis, axis)
    inside = all_seen.reshape(180, 180)[5:175, 5:175]
    assert inside.all()
    place = np.column_stack([np.tile(axis, 180), np.repeat(axis, 180)])
    np.testing.assert_allclose(still[all_seen], place[all_seen], atol=1e-9)  # nothing has moved
    assert np.isnan(origin[~seen]).all()


def test_too_few_points_are_refused():
    with pytest.raises(InputError, match="at least 3"):
        Mesh(np.zeros((2, 2)))


@pytest.mark.parametrize("by", [0.0, 0.2e-3, 0.5e-3])
def test_what_is_photographed_is_what_is_told(by):
    mesh = Mesh(VIEW.pixel(POINTS))
    moved = mesh.moved(VIEW.pixel_vector(opened(POINTS, by)), torn(POINTS) if by else None)
    axis = np.arange(20.0, 160.0)
    origin, seen = moved.origin_on(axis, axis)
    place = np.column_stack([np.tile(axis, axis.size), np.repeat(axis, axis.size)])[seen]
    told, material = moved.displacement_at(origin[seen])
    assert material.all()
    np.testing.assert_allclose(origin[seen] + told, place, atol=1e-8)  # the same linear map there and back
    assert not moved.displacement_at(np.array([[-500.0, 0.0]]))[1].any()
