"""Several placements of a lattice: what their mean does to an estimate, and what their scatter does to the interval."""

import numpy as np
import pytest

from pipeline.inverse.design import Design
from pipeline.inverse.estimate import Settings, Surrogate, estimate
from pipeline.inverse.objective import Objective
from pipeline.inverse.placements import Placements

from .hinge import CENTRE, load, measured, simulated

TRUTH = (1.02 * CENTRE[0], 0.97 * CENTRE[1])
GRID = Design(CENTRE)
HOW = Settings(Objective.LOAD, 0.0, surrogate=Surrogate.DATA)


def placed(*factors):
    """The test at TRUTH on lattices whose strength is off by factors."""
    return Placements(None, np.stack([load(f * TRUTH[0], TRUTH[1]) for f in factors]))


def test_a_lattice_that_is_too_strong_is_corrected_by_the_mean_of_its_placements():
    """Were the grid's own lattice 4 % stronger than the mean of all, f_max would come out 4 % low."""
    data = measured(TRUTH, None)
    alone = estimate(GRID, simulated(GRID), data, HOW)
    weaker = estimate(GRID, simulated(GRID), data, HOW, placed(1.0, 0.94, 0.98, 0.92))
    assert alone.f_max == pytest.approx(TRUTH[0], rel=1e-3)  # interpolation
    assert weaker.f_max / alone.f_max == pytest.approx(1.04, abs=0.004)  # the second order of 4 %, 0.16 %, doubled


def test_equal_placements_change_nothing():
    data = measured(TRUTH, np.random.default_rng(3))
    alone, same = (estimate(GRID, simulated(GRID), data, HOW, p) for p in (None, placed(1.0, 1.0, 1.0)))
    assert np.allclose(same.minimum.position, alone.minimum.position, rtol=1e-12)
    assert np.allclose(same.uncertainty.covariance, alone.uncertainty.covariance, rtol=1e-9)
    assert any("lattice lies" in text for text in alone.uncertainty.lacks)
    assert not any("lattice lies" in text for text in same.uncertainty.lacks)


def test_the_interval_holds_the_scatter_of_placements():
    """s over k placements: the mean of k and the specimen, one more of their kind, differ by s·√(1 + 1/k)."""
    factors = np.array([1.0, 0.97, 1.03, 0.98, 1.02])
    found = estimate(GRID, simulated(GRID), measured(TRUTH, None), HOW, placed(*factors))
    [part] = [c for c in found.uncertainty.budget if c.name == "placement"]
    wanted = np.std(factors, ddof=1) * np.sqrt(1 + 1 / 5)
    assert np.sqrt(part.covariance[0, 0]) / TRUTH[0] == pytest.approx(
        wanted, rel=0.05
    )  # the load is nearly linear in f_max
    assert part.freedom == 4
