"""The compiled factors against dense algebra; the engine with and without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from pipeline.core.units import MM
from pipeline.equilibrium import cholesky, condensation, far, network, schur
from pipeline.equilibrium.cholesky import Plan
from pipeline.equilibrium.solve import solve

from .specimens import fracture_test

pytestmark = pytest.mark.skipif(not cholesky.available(), reason="libcholesky.so is not built: see README")


def stiffness(size: int, springs: int, seed: int, base: float = 1.0) -> sparse.csc_array:
    """Springs of very different stiffness between random points that stand on springs of their own."""
    random = np.random.default_rng(seed)
    ends = random.integers(0, size, (springs, 2))
    ends = ends[ends[:, 0] != ends[:, 1]]
    row = np.arange(len(ends))
    incidence = sparse.coo_array((np.ones(len(ends)), (row, ends[:, 0])), shape=(len(ends), size))
    incidence = (incidence - sparse.coo_array((np.ones(len(ends)), (row, ends[:, 1])), shape=incidence.shape)).tocsr()
    weight = 10.0 ** random.uniform(-2, 1, len(ends))
    matrix = incidence.T @ (weight[:, None] * incidence) + base * sparse.eye_array(size)
    matrix = sparse.csc_array(matrix)
    matrix.sort_indices()
    return matrix


@given(size=st.integers(1, 90), density=st.floats(0, 4), seed=st.integers(0, 10**6), count=st.integers(1, 5))
def test_solutions_are_those_of_dense_algebra(size: int, density: float, seed: int, count: int) -> None:
    """Any order of elimination, forests, full matrices; one and several right-hand sides."""
    matrix = stiffness(size, int(density * size), seed)
    right = np.random.default_rng(seed).normal(size=(size, count))
    right[np.random.default_rng(seed + 1).random(size) < 0.5] = 0.0  # fronts without a load are passed over
    exact = np.linalg.solve(matrix.toarray(), right)
    plan = Plan(matrix)
    for single, error in ((False, 1e-12), (True, 3e-4)):  # round-off times the condition number, 1e3 at most
        factor = plan.factor(matrix, single)
        assert factor.raised == 0
        assert factor.solve(right) == pytest.approx(exact, abs=error)
        assert factor.solve(right[:, 0]) == pytest.approx(exact[:, 0], abs=error)


@given(size=st.integers(1, 60), density=st.floats(0, 3), seed=st.integers(0, 10**6))
def test_the_last_block_is_that_of_the_dense_factor(size: int, density: float, seed: int) -> None:
    """Whatever order is eliminated in, that which was given is answered in."""
    matrix, count = stiffness(size, int(density * size), seed), (size + 1) // 2
    exact = np.linalg.cholesky(matrix.toarray())[size - count :, size - count :]
    found = Plan(matrix).factor(matrix, single=False).last(count)
    assert found == pytest.approx(exact, abs=1e-12)  # round-off times the condition number


def test_one_plan_serves_all_matrices_of_its_pattern() -> None:
    first = stiffness(400, 900, 1)
    plan, right = Plan(first), np.ones(400)
    for factor in (1.0, 3.0):
        found = plan.factor(factor * first, single=False).solve(right)
        assert found == pytest.approx(right / factor, abs=1e-12)  # uniform: only the base of 1 N/m resists


def test_a_wide_front_is_factorised_in_blocks() -> None:
    """All variables coupled: one front of many blocks."""
    dense = np.random.default_rng(3).normal(size=(150, 150))
    dense = dense @ dense.T + 150 * np.eye(150)
    factor = Plan(sparse.csc_array(dense)).factor(sparse.csc_array(dense), single=False)
    assert factor.solve(np.eye(150)) == pytest.approx(np.linalg.inv(dense), abs=1e-14)  # entries of 1/150


def test_a_motion_without_resistance_is_given_some() -> None:
    """Loose points on springs lost in round-off: steps stay finite and downhill."""
    loose = stiffness(60, 150, 5, base=1e-12)
    factor = Plan(loose).factor(loose, single=True)
    assert factor.raised > 0
    for right in np.random.default_rng(5).normal(size=(20, 60)):
        step = factor.solve(right)
        assert np.isfinite(step).all()
        assert step @ right > 0


def test_patterns_that_do_not_fit_are_refused() -> None:
    matrix = stiffness(10, 20, 1)
    one_sided = sparse.csc_array(np.triu(matrix.toarray()))
    with pytest.raises(ValueError, match="the pattern is not symmetric"):
        Plan(one_sided)
    with pytest.raises(MemoryError, match="a diagonal entry is missing"):
        Plan(sparse.csc_array(np.array([[0.0, 1.0], [1.0, 2.0]])))
    with pytest.raises(ValueError, match="another pattern than the plan"):
        Plan(matrix).factor(one_sided, single=True)
    with pytest.raises(ValueError, match="has 10 entries, got 9"):
        Plan(matrix).factor(matrix, single=True).solve(np.ones(9))


def test_the_engine_finds_the_same_without_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = fracture_test(radius=1 * MM, scatter=0.6)
    problem = replace(problem, cmod_max=0.1 * MM, stations=np.array([0.05, 0.09]) * MM)
    fast = solve(problem, tolerance=1e-5)
    for module in (condensation, far, network, schur):
        monkeypatch.setattr(module, "available", lambda: False)
    slow = solve(problem, tolerance=1e-5)
    at = np.linspace(0.005, 0.095, 40) * MM
    peak = slow.curve.load.max()
    # residual of 1e-5 f_max; round-off decides whether an increment is repeated, which moves what is interpolated
    assert fast.curve.load_at(at) == pytest.approx(slow.curve.load_at(at), abs=5e-4 * peak)
    assert fast.displacement == pytest.approx(slow.displacement, abs=1e-4 * np.abs(slow.displacement).max())
