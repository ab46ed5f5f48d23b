"""Newton's method: analytic minima, edges, saddles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.inverse.design import Design
from pipeline.inverse.newton import Minimum, minimise
from pipeline.inverse.surrogate import LagrangeSurrogate

GRID = Design((71.0, 1.14e-4))


def surface(function) -> LagrangeSurrogate:
    """A function of x, y in [−1, 1] on the paper's grid."""
    x = np.linspace(-1, 1, 5)
    return LagrangeSurrogate(GRID.f_max, GRID.delta_max, function(*np.meshgrid(x, x, indexing="ij")))


def place(x: float, y: float) -> np.ndarray:
    return np.array([71.0 * (1 + 0.2 * x), 1.14e-4 * (1 + 0.2 * y)])


NODES = np.array(GRID.nodes())


@given(x=st.floats(-0.95, 0.95), y=st.floats(-0.95, 0.95), tilt=st.floats(-0.9, 0.9), size=st.floats(1e-12, 1e6))
def test_the_minimum_of_a_paraboloid(x, y, tilt, size):
    function = surface(lambda a, b: size * ((a - x) ** 2 + (b - y) ** 2 + 2 * tilt * (a - x) * (b - y)))
    best, *others = minimise(function, NODES[::6])
    assert not others
    assert best.converged
    assert best.interior
    assert best.convex
    np.testing.assert_allclose(best.position, place(x, y), rtol=1e-9)  # round-off 1e-16 over curvature 0.1
    np.testing.assert_allclose(
        best.hessian * np.outer([14.2, 2.28e-5], [14.2, 2.28e-5]),
        2 * size * np.array([[1, tilt], [tilt, 1]]),
        atol=1e-11 * size,
    )  # round-off of degree-4 sums


def test_newton_ends_quadratically():
    function = surface(lambda a, b: (a - 0.3) ** 2 + (b + 0.2) ** 2 + 0.1 * a**4)
    best = minimise(function, NODES[:1])[0]
    assert best.iterations <= 8  # two halvings of the box, then 1, 1e-2, 1e-4, 1e-8


def test_all_minima_of_a_double_well_are_found_the_deeper_first():
    function = surface(lambda a, b: (a**2 - 0.3) ** 2 + b**2 + 0.05 * a)
    roots = np.roots([4, 0, -1.2, 0.05])
    lower, upper = np.sort(roots.real)[[0, 2]]
    best, second = minimise(function, NODES)[:2]
    np.testing.assert_allclose(best.position, place(lower, 0), rtol=1e-8)  # the derivative's own roots
    np.testing.assert_allclose(second.position, place(upper, 0), rtol=1e-8)
    assert best.value < second.value


def test_a_start_on_a_saddle_or_ridge_still_ends_in_the_valley():
    function = surface(lambda a, b: (a**2 - 0.3) ** 2 + b**2 + 0.05 * a)
    best = minimise(function, place(0.05, 0.0)[None])[0]
    assert best.convex


@pytest.mark.parametrize(
    ("slope", "corner"), [((1, 0.5), (-1, -1)), ((-1, 0.5), (1, -1)), ((1, -0.5), (-1, 1)), ((-1, -0.5), (1, 1))]
)
def test_a_plane_ends_in_its_corner(slope, corner):
    best = minimise(surface(lambda a, b: slope[0] * a + slope[1] * b), NODES)[0]
    assert best.converged
    assert not best.interior
    np.testing.assert_allclose(best.position, place(*corner), rtol=1e-12)
    assert "edge" in best.status


def test_a_minimum_outside_is_met_at_the_edge_next_to_it():
    best = minimise(surface(lambda a, b: (a - 1.5) ** 2 + (b - 0.2) ** 2), NODES)[0]
    assert not best.interior
    np.testing.assert_allclose(best.position, place(1, 0.2), rtol=1e-9)  # along the edge it is still Newton


def test_rough_surfaces_are_searched_as_well_as_a_fine_raster_does():
    for seed in range(10):
        rough = surface(lambda a, b, seed=seed: np.random.default_rng(seed).random((5, 5)))
        raster = rough.on_grid(np.linspace(56.8, 85.2, 101), 1.14e-4 * np.linspace(0.8, 1.2, 101)).min()
        assert minimise(rough, NODES)[0].value <= raster + 1e-9  # the raster misses the minimum, never beats it


def test_status_is_a_sentence_for_each_ending():
    flat = Minimum(np.zeros(2), 0.0, np.diag([1.0, -1.0]), True, True, 3)
    assert "not positive definite" in flat.status
    assert "did not converge" in Minimum(np.zeros(2), 0.0, np.eye(2), False, True, 100).status
    assert "inside the grid in 4" in Minimum(np.zeros(2), 0.0, np.eye(2), True, True, 4).status


def test_convexity_does_not_depend_on_units():
    hessian = np.array([[1e-3, 10.0], [10.0, 1.1e5 + 1e-3]])  # N⁻² and m⁻² are eight decades apart
    assert Minimum(np.zeros(2), 0.0, hessian, True, True, 1).convex
    assert not Minimum(np.zeros(2), 0.0, hessian + np.array([[0, 1], [1, 0]]), True, True, 1).convex
