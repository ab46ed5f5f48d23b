"""Displacement figures: the arrows and colours are the data."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import CenteredNorm
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from pipeline.report.fields import difference_by_station, displacement_map, displacement_vectors
from pipeline.report.style import png

from .scene import BEAM, R, lattice

POINTS = np.array([(x, y) for x in (-6e-3, 6e-3) for y in (5e-3, 7e-3, 9e-3)])
OPENING = np.where(POINTS[:, :1] > 0, [[1e-5, 0.0]], [[-1e-5, 0.0]])
ALL = np.ones(6, bool)


def arrows(fit_rigid: bool, measured: np.ndarray, valid=ALL) -> list[np.ndarray]:
    axes = Figure().subplots()
    displacement_vectors(axes, BEAM, POINTS, measured, OPENING, valid, 1e-4, fit_rigid)
    found = [q for q in axes.collections if isinstance(q, Quiver)]
    return [np.column_stack([q.U, q.V]) for q in found[:2]]


def test_arrows_are_proportional_to_the_displacements():
    measured, simulated = arrows(False, 2 * OPENING)
    np.testing.assert_allclose(measured, 2 * simulated)
    np.testing.assert_allclose(simulated[:, 1], 0)
    assert np.hypot(*measured.T).max() == pytest.approx(0.16 * 12)  # mm; the longest is 16 % of the points' width


def test_rigid_motion_is_taken_out_of_each():
    slipped = OPENING + 1e-3 + 5e-3 * np.column_stack([-POINTS[:, 1], POINTS[:, 0]])
    measured, simulated = arrows(True, slipped)
    np.testing.assert_allclose(measured, simulated, atol=1e-9)
    kept, _ = arrows(False, slipped)
    assert not np.allclose(kept, simulated)


def test_points_that_were_not_compared_have_no_arrow():
    valid = np.array([True, True, False, True, True, True])
    assert len(arrows(True, OPENING, valid)[0]) == 5


def test_difference_by_hand():
    measured, simulated = np.zeros((2, 6, 2)), np.zeros((2, 6, 2))
    measured[0] = (3e-6, 4e-6)
    measured[1, 0] = (1e-6, 0)
    valid = np.ones((2, 6), bool)
    valid[1, 2:] = False
    axes = Figure().subplots()
    difference_by_station(axes, np.array([1e-4, 2e-4]), measured, simulated, valid, 0.4e-6)
    np.testing.assert_allclose(axes.lines[0].get_ydata(), [5, np.sqrt(0.5)])  # µm
    assert axes.lines[1].get_ydata()[0] == pytest.approx(0.4 * np.sqrt(2))


def test_a_station_without_points_is_a_gap():
    axes = Figure().subplots()
    difference_by_station(axes, np.array([1e-4]), np.ones((1, 6, 2)), np.zeros((1, 6, 2)), np.zeros((1, 6), bool), 1e-6)
    assert np.isnan(axes.lines[0].get_ydata()[0])


def test_maps_carry_micrometres_and_opposite_motion_is_centred():
    particles, _ = lattice()
    displacement = np.column_stack([particles.position[:, 0] * 1e-3, -1e-5 - 0 * particles.position[:, 0]])
    figure = Figure()
    for component, axes in enumerate(figure.subplots(1, 2)):
        displacement_map(axes, BEAM, particles.position, R, displacement, component)
        painted = axes.collections[0]
        np.testing.assert_allclose(painted.get_array(), displacement[:, component] * 1e6)
        assert isinstance(painted.norm, CenteredNorm) == (component == 0)


def test_all_can_be_rendered():
    particles, _ = lattice()
    u = 1e-3 * particles.position
    assert png(
        lambda a: displacement_vectors(a, BEAM, POINTS, OPENING, OPENING, np.ones(6, bool), 1e-4, True),
        lambda a: displacement_map(a, BEAM, particles.position, R, u, 1),
        columns=2,
    )
