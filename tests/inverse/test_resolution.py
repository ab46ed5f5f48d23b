"""Whether a grid resolves its valley: interpolated data against interpolated Φ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.inverse.design import Design
from pipeline.inverse.estimate import Settings, estimate
from pipeline.inverse.objective import Objective

from .hinge import CENTRE, measured, simulated

HALF = (0.8, 1.0, 1.2)
WIDE = Design(CENTRE, (0.6, 1.0, 1.4), (0.6, 1.0, 1.4))
TRUTH = np.array([75.3, 1.07e-4])


def found_on(grid: Design):
    return estimate(grid, simulated(grid), measured(tuple(TRUTH), None), Settings(Objective.BOTH, 0.0))


def test_interpolated_data_find_the_truth_where_the_grid_is_wide():
    found = found_on(WIDE)
    error = np.abs(found.minimum.position / TRUTH - 1).max()
    of_data = np.abs(found.data_position / TRUTH - 1).max()
    assert of_data < error / 5  # data bend less than their squares: 0.5 % against 13 %


def test_halving_the_grid_brings_the_two_minima_together():
    """A multinomial of degree two each way errs with the third power of the distance, its slope with the square."""
    coarse = found_on(WIDE)
    fine = found_on(Design(tuple(coarse.data_position), HALF, HALF))
    apart = [np.abs(f.minimum.position - f.data_position).max() / CENTRE[0] for f in (coarse, fine)]
    assert apart[1] < apart[0] / 3  # 4 for small distances


def test_noise_decides_what_is_resolved():
    grid = Design(CENTRE, (0.8, 1.0, 1.2), (0.8, 1.0, 1.2))
    data = measured(tuple(TRUTH), np.random.default_rng(5))
    noisy = replace(data, load_std=100 * data.load_std)
    quiet, loud = (estimate(grid, simulated(grid), m, Settings(Objective.LOAD, 0.0)) for m in (data, noisy))
    assert np.abs(quiet.minimum.position / quiet.data_position - 1).max() > 0.01  # three lines are too few
    assert not quiet.resolved
    assert loud.resolved  # the same difference, lost in a hundred times the noise
    five = Design(CENTRE)
    assert estimate(five, simulated(five), data, Settings(Objective.LOAD, 0.0)).resolved


def test_an_estimate_without_interval_is_not_resolved():
    data = measured((96.0, 0.84e-4), np.random.default_rng(4))
    grid = Design(CENTRE)
    found = estimate(grid, simulated(grid), data, Settings(Objective.BOTH, 0.0))
    assert found.uncertainty is None
    assert not found.resolved
    assert found.data_position == pytest.approx(np.clip(found.data_position, grid.nodes()[0], grid.nodes()[-1]))
