"""The second surrogate: it finds the same minimum where the data are smooth, another one where multinomials swing."""

import numpy as np
import pytest

from pipeline.inverse.design import Design
from pipeline.inverse.objective import Objective, Rigid, compare, differences
from pipeline.inverse.radial import radial_minimum
from pipeline.inverse.surrogate import LagrangeSurrogate

from .hinge import CENTRE, measured, simulated

TRUTH = (1.03 * CENTRE[0], 0.95 * CENTRE[1])


def features_of(design, data):
    comparison = compare(data, simulated(design), Objective.BOTH, Rigid.FIT)
    _, features = differences(comparison, simulated(design))
    return LagrangeSurrogate(design.f_max, design.delta_max, features), comparison.target


def test_smooth_data_without_noise_give_the_truth():
    found = radial_minimum(*features_of(Design(CENTRE), measured(TRUTH, None)))
    assert found == pytest.approx(TRUTH, rel=2e-3)  # interpolation between lines 10 % apart


def test_data_that_are_quadratic_are_reproduced():
    """The polynomial part has degree two: the interpolant is exact, and so is its minimum."""
    f, d = np.linspace(0.8, 1.2, 5), np.linspace(0.8, 1.2, 5)
    a, b = np.meshgrid(f, d, indexing="ij")
    values = np.stack([a + 0.3 * a * b, b - 0.2 * a**2, a * b + 0.5 * b**2], axis=-1)
    x, y = 0.93, 1.07
    target = np.array([x + 0.3 * x * y, y - 0.2 * x**2, x * y + 0.5 * y**2])
    found = radial_minimum(LagrangeSurrogate(f, d, values), target)
    assert found == pytest.approx((x, y), abs=1e-4)  # L-BFGS-B with differences


def test_an_optimum_outside_ends_on_the_edge():
    found = radial_minimum(*features_of(Design(CENTRE), measured((1.5 * CENTRE[0], CENTRE[1]), None)))
    assert found[0] == pytest.approx(1.2 * CENTRE[0])
