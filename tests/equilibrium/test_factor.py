"""Rough solutions: they may be rough, but must stay symmetric and positive definite."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.equilibrium.factor import rough_dense_solve


def symmetric(*eigenvalues: float) -> np.ndarray:
    shape, _ = np.linalg.qr(np.random.default_rng(4).standard_normal((len(eigenvalues), len(eigenvalues))))
    return (shape * eigenvalues) @ shape.T


def test_a_definite_matrix_is_solved_to_single_precision():
    matrix = symmetric(1.0, 2.0, 5.0, 9.0)
    right = np.array([1.0, -2.0, 0.5, 3.0])
    # eight digits less one for the condition of nine
    np.testing.assert_allclose(matrix @ rough_dense_solve(matrix)(right), right, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("smallest", [1e-12, 0.0, -1e-9])
def test_a_matrix_that_round_off_makes_indefinite_still_measures_steps(smallest):
    """Islands that have softened all but to nothing: seen on a beam of 1 mm, where the factorisation broke down."""
    matrix = symmetric(smallest, 1e-9, 1.0, 3.0)
    solve = rough_dense_solve(matrix)
    inverse = np.column_stack([solve(column) for column in np.eye(4)])
    np.testing.assert_allclose(inverse, inverse.T, atol=1e-7 * np.abs(inverse).max())  # round-off
    assert np.linalg.eigvalsh(0.5 * (inverse + inverse.T)).min() > 0
    strong = np.linalg.eigh(matrix)[1][:, 2:]  # what is well determined is solved as by any other way
    np.testing.assert_allclose(strong.T @ inverse @ strong, np.diag([1.0, 1 / 3]), atol=1e-6)


def test_even_a_matrix_of_nothing_measures_steps():
    for matrix in (np.zeros((2, 2)), -1e-9 * np.eye(2)):
        inverse = np.column_stack([rough_dense_solve(matrix)(column) for column in np.eye(2)])
        assert np.linalg.eigvalsh(inverse).min() > 0
