"""The multinomial: what it must reproduce, and what its leave-one-out error is worth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import polynomial

from pipeline.core.errors import InputError
from pipeline.inverse.surrogate import LagrangeSurrogate, lagrange_basis, leave_one_out, node_scatter

F_MID, D_MID = 71.0, 1.14e-4


def lines(n: int, middle: float) -> np.ndarray:
    return middle * np.linspace(0.8, 1.2, n)


def scaled(f, d) -> tuple:
    return (np.asarray(f) / F_MID - 1) / 0.2, (np.asarray(d) / D_MID - 1) / 0.2


def derivative(c: np.ndarray, order_f: int, order_d: int) -> np.ndarray:
    return polynomial.polyder(polynomial.polyder(c, order_f, 0.2**-1 / F_MID, 0), order_d, 0.2**-1 / D_MID, 1)


@settings(max_examples=60)
@given(n_f=st.integers(3, 8), n_d=st.integers(3, 8), seed=st.integers(0, 10**6), x=st.floats(-1, 1), y=st.floats(-1, 1))
def test_polynomials_of_the_grids_degree_are_reproduced_with_their_derivatives(n_f, n_d, seed, x, y):
    c = np.random.default_rng(seed).uniform(-1, 1, (n_f, n_d))
    f_nodes, d_nodes = lines(n_f, F_MID), lines(n_d, D_MID)
    surrogate = LagrangeSurrogate(f_nodes, d_nodes, polynomial.polygrid2d(*scaled(f_nodes, d_nodes), c))
    at = np.array([F_MID * (1 + 0.2 * x), D_MID * (1 + 0.2 * y)])

    def exact(i: int, j: int) -> float:
        return float(polynomial.polyval2d(*scaled(*at), derivative(c, i, j)))

    # round-off of 64 terms of order one, amplified by the Lebesgue constant (below 40 for 8 nodes), per derivative by
    # the square of the degree
    tolerance = np.array([1.0, 5 / F_MID, 5 / D_MID, 25 / F_MID**2, 25 / F_MID / D_MID, 25 / D_MID**2]) * 1e-12 * 50
    (ff, fd), (df, dd) = surrogate.hessian(at)
    found = [surrogate.value(at), *surrogate.gradient(at), ff, fd, dd]
    expected = [exact(0, 0), exact(1, 0), exact(0, 1), exact(2, 0), exact(1, 1), exact(0, 2)]
    assert np.all(np.abs(np.array(found) - expected) <= tolerance)
    assert fd == df


def test_nodes_are_met_exactly():
    values = np.random.default_rng(0).standard_normal((5, 6))
    surrogate = LagrangeSurrogate(lines(5, F_MID), lines(6, D_MID), values)
    met = [[surrogate.value(np.array([f, d])) for d in surrogate.d_nodes] for f in surrogate.f_nodes]
    np.testing.assert_array_equal(met, values)
    np.testing.assert_array_equal(surrogate.on_grid(surrogate.f_nodes, surrogate.d_nodes), values)


def test_a_field_at_every_node_is_interpolated_entry_by_entry():
    values = np.random.default_rng(1).standard_normal((4, 4, 3, 2))
    at = np.array([70.0, 1.2e-4])
    nodes = lines(4, F_MID), lines(4, D_MID)
    whole, one = LagrangeSurrogate(*nodes, values), LagrangeSurrogate(*nodes, values[..., 1, 0])
    assert whole.gradient(at).shape == (2, 3, 2)
    np.testing.assert_allclose(whole.hessian(at)[..., 1, 0], one.hessian(at), rtol=1e-12)  # the same sums


def test_the_basis_sums_to_one_and_its_derivatives_to_zero():
    found = lagrange_basis(lines(6, 1.0), 0.93, 3).sum(axis=1)
    np.testing.assert_allclose(found, [1, 0, 0], atol=1e-12)  # round-off; derivatives are of order 100


def test_weights_of_the_nodes_are_the_change_per_change_of_a_node():
    surrogate = LagrangeSurrogate(lines(5, F_MID), lines(5, D_MID), np.random.default_rng(2).standard_normal((5, 5)))
    at, weights = np.array([73.0, 1.07e-4]), surrogate.of_nodes()
    assert np.sum(weights.value(at) * surrogate.values) == pytest.approx(surrogate.value(at), rel=1e-12)
    total = np.einsum("xpq,pq->x", weights.gradient(at), surrogate.values)
    np.testing.assert_allclose(total, surrogate.gradient(at), rtol=1e-12)  # P is linear in its nodes


def test_leaving_out_a_node_of_a_lower_degree_polynomial_costs_nothing():
    c = np.random.default_rng(3).standard_normal((4, 4))  # degree 3 on a grid of 5: one node a line is superfluous
    surrogate = LagrangeSurrogate(
        lines(5, F_MID), lines(5, D_MID), polynomial.polygrid2d(*scaled(lines(5, F_MID), lines(5, D_MID)), c)
    )
    assert leave_one_out(surrogate).shape == (30,)
    assert np.abs(leave_one_out(surrogate)).max() < 1e-13  # round-off of numbers of order one


def smooth(rng: np.random.Generator):
    """A sum of squares of exponentials: what Φ looks like."""
    rate, phase = rng.uniform(0.2, 1.2, (6, 2)) * rng.choice([-1, 1], (6, 2)), rng.uniform(0.5, 1.5, 6)
    return lambda x, y: sum((np.exp(a * x + b * y) - p) ** 2 for (a, b), p in zip(rate, phase, strict=True))


def test_the_leave_one_out_error_covers_the_error_between_nodes():
    covered = []
    for seed in range(40):
        function = smooth(np.random.default_rng(seed))
        x = np.linspace(-1, 1, 5)
        surrogate = LagrangeSurrogate(lines(5, F_MID), lines(5, D_MID), function(*np.meshgrid(x, x, indexing="ij")))
        between = np.linspace(-0.9, 0.9, 14)
        truth = function(*np.meshgrid(between, between, indexing="ij"))
        error = surrogate.on_grid(F_MID * (1 + 0.2 * between), D_MID * (1 + 0.2 * between)) - truth
        covered.append(np.sqrt(np.mean(error**2)) <= np.sqrt(np.mean(leave_one_out(surrogate) ** 2)))
    assert all(covered)  # the prediction lacks a degree that the surrogate has


@pytest.mark.parametrize(("n_f", "n_d", "freedom"), [(5, 5, 10), (6, 6, 15), (4, 6, 11), (3, 3, 3)])
def test_scatter_of_the_nodes_is_measured(n_f, n_d, freedom):
    found = []
    for seed in range(300):
        values = np.random.default_rng(seed).normal(0, 3.0, (n_f, n_d))
        std, count = node_scatter(LagrangeSurrogate(lines(n_f, F_MID), lines(n_d, D_MID), values))
        assert count == freedom
        found.append(std)
    # χ² of 300 × freedom: three standard errors of a root mean square
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(3.0, rel=3 / np.sqrt(2 * 300 * freedom))


def test_a_smooth_surface_counts_as_scatter_only_to_the_fifth_order():
    """On a grid half as wide the part taken for scatter falls by 2⁵, and so vanishes beside curvature."""
    for seed in range(20):
        function, found = smooth(np.random.default_rng(seed)), []
        for width in (0.25, 0.125):
            x = width * np.linspace(-1, 1, 5)
            values = function(*np.meshgrid(x, x, indexing="ij"))
            found.append(node_scatter(LagrangeSurrogate(lines(5, F_MID), lines(5, D_MID), values))[0])
        assert found[0] / found[1] == pytest.approx(32, rel=0.25)  # the sixth order adds a share of the width


@pytest.mark.parametrize(
    ("f_nodes", "values", "says"),
    [
        ([60.0, 50.0, 70.0], np.zeros((3, 3)), "increasing"),
        ([60.0], np.zeros((1, 3)), "at least two"),
        ([50.0, 60.0, 70.0], np.zeros((3, 4)), "3 × 3"),
        ([50.0, 60.0, 70.0], np.diag([0, np.nan, 0]), r"node \(1, 1\) is not finite"),
    ],
)
def test_refusals(f_nodes, values, says):
    with pytest.raises(InputError, match=says):
        LagrangeSurrogate(np.array(f_nodes), lines(3, D_MID), values)
