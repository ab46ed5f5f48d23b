"""Grips as constraints: they hold identically, and their reactions are Lagrange multipliers."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.core.problem import Grip, Role
from pipeline.equilibrium.constraints import eliminate


def grips(rng: np.random.Generator) -> tuple[Grip, ...]:
    """Two grips that share particles in orthogonal directions, and a third in an odd direction."""
    shared, other = np.array([1, 4, 5]), np.array([0, 2, 7, 8])
    weights = [w / w.sum() for w in (rng.uniform(0.5, 1, 3), rng.uniform(0.5, 1, 3), rng.uniform(0.5, 1, 4))]
    return (
        Grip("platen", shared, weights[0], np.array([0.0, -1.0]), 1.0, Role.DRIVE),
        Grip("centre", shared, weights[1], np.array([1.0, 0.0]), 0.0, Role.GUIDE),
        Grip("support", other, weights[2], np.array([0.6, 0.8]), 0.0, Role.REACT),
    )


def test_grips_hold_for_any_free_variables() -> None:
    rng = np.random.default_rng(1)
    held = grips(rng)
    constraints = eliminate(held, 10)
    moved = constraints.displacement(rng.normal(size=constraints.expand.shape[1]), 0.3)
    means = [grip.mean(moved) for grip in held]
    assert means == pytest.approx([0.3, 0.0, 0.0], abs=1e-14)  # round-off of a sum of four


def test_free_variables_come_back() -> None:
    rng = np.random.default_rng(2)
    constraints = eliminate(grips(rng), 10)
    free = rng.normal(size=17)
    assert np.array_equal(constraints.restrict(constraints.displacement(free, 0.3)), free)


def test_reactions_are_the_multipliers() -> None:
    """Internal forces Aᵀ λ leave the free variables in balance and return λ."""
    rng = np.random.default_rng(3)
    held, wanted = grips(rng), np.array([5.0, -2.0, 3.0])
    internal = np.zeros((10, 2))
    for grip, force in zip(held, wanted, strict=True):
        internal[grip.index] += force * grip.weight[:, None] * grip.direction
    constraints = eliminate(held, 10)
    assert constraints.reactions(internal.ravel()) == pytest.approx(wanted, rel=1e-13)  # a 3×3 solve
    assert constraints.expand.T @ internal.ravel() == pytest.approx(np.zeros(17), abs=1e-13)


def test_the_same_motion_twice_is_refused() -> None:
    twice = (*grips(np.random.default_rng(4)), grips(np.random.default_rng(4))[0])
    with pytest.raises(InputError, match="prescribe the same motion twice: remove one of them"):
        eliminate(twice, 10)
