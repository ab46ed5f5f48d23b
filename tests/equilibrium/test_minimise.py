"""The minimiser on functions whose minimum is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from pipeline.equilibrium.minimise import minimise
from pipeline.materials.cohesive import LinearSoftening


@dataclass
class Diagonal:
    """A preconditioner that knows only the diagonal."""

    diagonal: np.ndarray

    def solve(self, gradient: np.ndarray) -> np.ndarray:
        return gradient / self.diagonal

    def renew(self, at: np.ndarray) -> None:
        pass


def quadratic(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(n)
    factor = rng.normal(size=(n, n))
    return factor @ factor.T + np.eye(n), rng.normal(size=n)


def test_exact_preconditioner_needs_one_step() -> None:
    matrix, pull = quadratic(8)

    class Exact(Diagonal):
        def solve(self, gradient: np.ndarray) -> np.ndarray:
            return np.linalg.solve(matrix, gradient)

    found = minimise(lambda q: matrix @ q - pull, Exact(np.ones(8)), np.zeros(8), 1e-10)
    assert found.converged
    assert found.iterations == 1


def test_quadratic_with_and_without_a_constraint() -> None:
    matrix, pull = quadratic(12)
    normal = np.random.default_rng(0).normal(size=12)
    start = normal / (normal @ normal)  # normal · q = 1
    preconditioner = Diagonal(np.diag(matrix))
    free = minimise(lambda q: matrix @ q - pull, preconditioner, start, 1e-9)
    assert free.at == pytest.approx(np.linalg.solve(matrix, pull), abs=1e-8)  # 1e-9 over the smallest eigenvalue 1
    held = minimise(lambda q: matrix @ q - pull, preconditioner, start, 1e-9, constraint=normal)
    bordered = np.block([[matrix, -normal[:, None]], [normal[None], np.zeros((1, 1))]])
    exact = np.linalg.solve(bordered, np.append(pull, 1.0))
    assert held.at == pytest.approx(exact[:-1], abs=1e-8)
    assert held.multiplier == pytest.approx(exact[-1], rel=1e-6)  # residual 1e-9 over |normal| ≈ 3, condition 1e2
    assert normal @ held.at == pytest.approx(1, rel=1e-12)  # every step lies in the plane


def test_a_function_that_is_not_convex() -> None:
    """log(1 + q²) per variable, the model of softening: concave beyond 1; its secant 2/(1 + q²) majorises it."""

    class Secant(Diagonal):
        def renew(self, at: np.ndarray) -> None:
            self.diagonal = 2 / (1 + at**2)

    start = np.linspace(-5, 7, 13)
    secant = Secant(2 / (1 + start**2))
    found = minimise(lambda q: 2 * q / (1 + q**2), secant, start, 1e-10, patience=1)
    assert found.converged
    assert np.abs(found.at).max() < 1e-10


def test_running_out_of_iterations_is_said() -> None:
    matrix, pull = quadratic(40)
    found = minimise(lambda q: matrix @ q - pull, Diagonal(np.ones(40)), np.zeros(40), 1e-12, limit=3)
    assert not found.converged
    assert found.iterations == 3
    assert found.residual > 1e-12


def test_short_steps_do_not_leap_over_what_would_hold() -> None:
    """A pressed bond in a preconditioner that is far too soft: one full step breaks it, short ones find its rest."""
    law = LinearSoftening(np.array([1.0]), np.array([1.0]), np.array([50.0]))
    soft = Diagonal(np.array([1e-6]))

    def force(q: np.ndarray) -> np.ndarray:
        return law.force(q, np.zeros(1))

    start = np.array([-0.5])
    assert minimise(force, soft, start, 1e-6).at[0] > 50, "flew through its strength, and rests where nothing pulls"
    held = minimise(force, soft, start, 1e-6, reach=0.25 * 50)
    assert held.converged
    assert held.at == pytest.approx([0.0], abs=1e-6)  # the tolerance over the stiffness
