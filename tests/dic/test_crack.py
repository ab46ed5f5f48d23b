"""Crack path, tip and opening profile of displacement fields."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.dic.crack import find_crack
from pipeline.dic.jumps import kernel

ROWS, COLUMNS = np.mgrid[:90, :110]
GRID = np.column_stack([COLUMNS.ravel(), ROWS.ravel()]).astype(float)


def sharp_tip(points, tip, angle, amplitude=0.02, slide=0.0):
    """Opening amplitude × √(distance from the tip) behind the tip, on top of strain; the near field of a crack."""
    c, s = np.cos(angle), np.sin(angle)
    arm = points - tip
    along, across = arm @ [c, s], arm @ [-s, c]
    radius = np.hypot(along, across)
    turn = np.arctan2(across, along)  # the cut lies at ±π, behind the tip
    open_by, slide_by = (a * np.sqrt(radius) * np.sin(turn / 2) / 2 for a in (amplitude, slide))
    return np.outer(open_by, [-s, c]) + np.outer(slide_by, [c, s]) + 1e-4 * points


@pytest.mark.parametrize("angle", [0.0, 0.35, -0.5])
def test_path_tip_and_opening_of_a_sharp_crack(angle):
    tip = np.array([62.0, 45.0])
    noise = np.random.default_rng(1).normal(0, 1e-3, (len(GRID), 2))
    crack = find_crack(GRID, sharp_tip(GRID, tip, angle) + noise)
    assert np.linalg.norm(crack.tip - tip) < 2.5  # nodes; a window reaches seven
    along = (crack.path - tip) @ [np.cos(angle), np.sin(angle)]
    across = (crack.path - tip) @ [-np.sin(angle), np.cos(angle)]
    assert np.median(np.abs(across)) < 0.7
    behind = (along < -8) & (along > -45)
    expected = 0.02 * np.sqrt(-along[behind])
    np.testing.assert_allclose(np.abs(crack.opening[behind]), expected, rtol=0.1)  # planes through curved flanks
    assert np.all(crack.opening[behind] > 0)  # parting is positive
    assert np.all(np.diff(crack.closing) <= 0)
    assert crack.closing[-1] == 0
    assert not crack.through


def test_stated_deviation_of_the_opening():
    tip, expected = np.array([200.0, 45.0]), []
    for seed in range(6):
        noise = np.random.default_rng(seed).normal(0, 2e-3, (len(GRID), 2))
        field = np.where(GRID[:, 1:] > 44.5, 0.05, -0.05) * [[0, 1]] + noise
        crack = find_crack(GRID, field, blur=1)
        expected.append((crack.opening[20:90:10] - 0.1) / crack.std[20:90:10])
    assert crack.through
    assert tip.size == 2
    assert 0.7 < np.std(expected) < 1.4  # 42 draws


def test_scattered_points_with_holes_and_spikes():
    random = np.random.default_rng(2)
    points = GRID + random.uniform(-0.3, 0.3, GRID.shape)
    field = sharp_tip(points, np.array([60.0, 45.0]), 0.1) + random.normal(0, 1e-3, GRID.shape)
    field[random.integers(0, len(GRID), 30)] += 0.5
    valid = random.random(len(GRID)) > 0.1
    crack = find_crack(points, field, valid)
    assert np.linalg.norm(crack.tip - [60, 45]) < 5  # as above, with a tenth of the points missing


def test_the_mouth_is_where_it_is_said_to_be():
    field = sharp_tip(GRID, np.array([62.0, 45.0]), 0.0)
    noise = np.random.default_rng(1).normal(0, 1e-3, field.shape)
    crack = find_crack(GRID, field + noise, mouth=np.array([0.0, 45.0]))
    assert crack.path[0, 0] < 12
    assert crack.arc[0] == 0
    assert crack.length == pytest.approx(62, abs=6)


def test_the_path_bends_with_the_crack_close_to_the_border():
    course = 70.0 - 0.6 * np.maximum(76 - GRID[:, 1], 0)  # slanting, then straight down into the border
    side = np.where(GRID[:, 0] > course, 0.5, -0.5)
    opening = 0.4 + 0.01 * GRID[:, 1]
    field = np.column_stack([side * opening, 0 * side]) + np.random.default_rng(4).normal(0, 0.01, GRID.shape)
    crack = find_crack(GRID, field, mouth=np.array([70.0, 89.0]))
    low = crack.path[:, 1] > 76
    assert low.sum() > 8
    assert np.abs(crack.path[low, 0] - 70).max() < 1.5  # nodes; straight on it would be off by eight
    np.testing.assert_allclose(crack.opening[low], 0.4 + 0.01 * crack.path[low, 1], rtol=0.06)


def test_a_smooth_field_has_no_crack():
    random = np.random.default_rng(0)
    field = np.column_stack([1e-3 * GRID[:, 0], np.sin(GRID[:, 0] / 30)]) + random.normal(0, 1e-3, GRID.shape)
    with pytest.raises(ConvergenceError, match="crack"):
        find_crack(GRID, field)


def test_small_fields_are_refused():
    with pytest.raises(InputError, match="at least 100"):
        find_crack(GRID[:50], np.zeros((50, 2)))


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.3])
def test_kernel_sees_a_unit_step_and_no_plane(angle):
    weights = kernel(angle, 2)
    reach = weights.shape[0] // 2
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    side = np.sign(x * np.cos(angle) + y * np.sin(angle))
    assert np.sum(weights * 0.5 * side) == pytest.approx(1, abs=1e-12)  # by construction
    assert np.sum(weights * (3 + 2 * x - y)) == pytest.approx(0, abs=1e-9)  # round-off over some hundred nodes


TIPS = [(40, 128), (99, 129), (155, 122)]  # column, row


@pytest.mark.parametrize("stage", [0, 1, 2])
def test_measured_fatigue_crack(stage, shared_data):
    data = np.load(shared_data / "crackpy_dic_crack" / "dic_crack_fields.npz")
    rows, columns = np.mgrid[:256, :256]
    points = np.column_stack([columns.ravel(), rows.ravel()]).astype(float)
    crack = find_crack(points, np.moveaxis(data["disp_mm"][stage], 0, -1).reshape(-1, 2))
    label = np.argwhere(data["label"][stage] == 1)[:, ::-1]
    off = cKDTree(label).query(crack.path)[0]
    assert np.quantile(off, 0.85) < 3  # README: within 3 px; the first columns hold spurious facets
    assert off.max() < 4.5
    assert np.linalg.norm(crack.tip - TIPS[stage]) < 8  # README
    jump = [0.036, 0.098, 0.175][stage]  # README: uy(row + 6) − uy(row − 6) at mid crack, mm; planes reach the line
    middle = crack.opening[len(crack.opening) // 2]
    assert 0.7 * jump < middle < 1.1 * jump
    assert crack.closing[-1] == 0
    assert np.all(np.diff(crack.closing) <= 0)
