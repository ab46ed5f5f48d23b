"""The sparse grid: polynomials it must reproduce, derivatives, and how many nodes it takes."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.inverse.sparse import SparseGrid


def grid(d):
    return SparseGrid(np.array([71.0, 1.14e-4, 1.0, 0.95])[:d], np.array([14.2, 2.3e-5, 0.2, 0.15])[:d])


def monomials(d):
    """Powers of every polynomial that the grid holds: total degree two, and up to four in one parameter alone."""
    return [p for p in product(range(5), repeat=d) if sum(p) <= 2 or (np.count_nonzero(p) == 1 and max(p) <= 4)]


@pytest.mark.parametrize(("d", "count"), [(2, 13), (3, 25), (4, 41)])
def test_nodes_are_few_distinct_and_cardinal(d, count):
    one = grid(d)
    assert one.nodes.shape == (count, d)
    assert len(np.unique(one.nodes, axis=0)) == count
    assert np.array_equal(one.nodes[0], one.centre)
    weights = np.stack([one.value(node) for node in one.nodes])
    np.testing.assert_allclose(weights, np.eye(count), atol=1e-12)  # round-off of sums of a few tens


@settings(max_examples=30)
@given(st.integers(2, 4), st.integers(0, 2**32 - 1))
def test_polynomials_are_reproduced_with_their_derivatives(d, seed):
    rng, one = np.random.default_rng(seed), grid(d)
    powers = np.array(monomials(d))
    factors = rng.normal(size=len(powers))
    at = rng.uniform(-1, 1, d)

    def value(x, order):
        """Σ c Π x^p, derived `order` times in each of the scaled parameters."""
        falling = [[1.0] * 5, [0.0, 1, 2, 3, 4], [0.0, 0, 2, 6, 12]]
        rows = [[falling[n][q] * v ** max(q - n, 0) for q in range(5)] for v, n in zip(x, order, strict=True)]
        return factors @ np.prod(np.array(rows)[np.arange(d), powers], axis=1)

    values = np.array([value((node - one.centre) / one.half, np.zeros(d, int)) for node in one.nodes])
    point = one.centre + at * one.half
    unit = np.eye(d, dtype=int)
    assert one.value(point) @ values == pytest.approx(value(at, np.zeros(d, int)), abs=1e-10)
    slopes = one.gradient(point) @ values * one.half
    np.testing.assert_allclose(slopes, [value(at, u) for u in unit], atol=1e-9)
    bends = one.hessian(point) @ values * np.outer(one.half, one.half)
    np.testing.assert_allclose(bends, [[value(at, a + b) for a in unit] for b in unit], atol=1e-8)
    assert one.value(point).sum() == pytest.approx(1, abs=1e-12)


def test_a_grid_without_width_is_refused():
    with pytest.raises(InputError, match="positive half widths"):
        SparseGrid(np.array([1.0, 2.0]), np.array([0.1, 0.0]))
