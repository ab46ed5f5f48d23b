"""Whether a grid resolves its valley: interpolated data against interpolated Φ."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.inverse.design import Design
from pipeline.inverse.estimate import Settings, estimate
from pipeline.inverse.objective import Objective
from pipeline.inverse.resolution import resolves

from .hinge import CENTRE, measured, simulated

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
    fine = found_on(WIDE.refined(*coarse.data_position))
    apart = [np.abs(f.minimum.position - f.data_position).max() / CENTRE[0] for f in (coarse, fine)]
    assert apart[1] < apart[0] / 3  # 4 for small distances


def test_an_interval_decides_what_is_resolved():
    grid, noise = Design(CENTRE), np.random.default_rng(5)
    found = estimate(grid, simulated(grid), measured(tuple(TRUTH), noise), Settings(Objective.BOTH, 0.0))
    assert found.resolved  # five lines 10 % apart do for this smooth model
    here, near = found.minimum.position, found.minimum.position * 1.0005
    assert resolves(here, near, found.uncertainty)  # less than a thousandth apart
    assert not resolves(here, here * 1.5, found.uncertainty)
    assert not resolves(here, here, None)


def test_an_estimate_without_interval_is_not_resolved():
    data = measured((96.0, 0.84e-4), np.random.default_rng(4))
    grid = Design(CENTRE)
    found = estimate(grid, simulated(grid), data, Settings(Objective.BOTH, 0.0))
    assert found.uncertainty is None
    assert not found.resolved
    assert found.data_position == pytest.approx(np.clip(found.data_position, grid.nodes()[0], grid.nodes()[-1]))
