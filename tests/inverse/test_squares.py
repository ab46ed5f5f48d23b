"""Multinomials through the data: derivatives, and what they gain where crack paths change from node to node."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.inverse.design import Design
from pipeline.inverse.estimate import Settings, Surrogate, estimate
from pipeline.inverse.objective import Objective
from pipeline.inverse.squares import SquaredDifference
from pipeline.inverse.surrogate import LagrangeSurrogate

from .hinge import CENTRE, measured, simulated

GRID = Design(CENTRE)
SIMULATED = simulated(GRID)


def test_derivatives_are_those_of_a_known_square():
    """d = (a, b, ab) is met exactly by two lines each way, so Φ and its derivatives are known in closed form."""
    a, b = np.array([1.0, 2.0, 4.0]), np.array([0.5, 1.0, 3.0])
    data = np.stack([*np.meshgrid(a, b, indexing="ij"), np.outer(a, b)], axis=-1)
    squares = SquaredDifference.of(LagrangeSurrogate(a, b, data), np.array([1.0, 2.0, 5.0]))
    x, y = 3.0, 2.5
    r = np.array([x - 1, y - 2, x * y - 5])
    assert squares.value(np.array([x, y])) == pytest.approx(r @ r, rel=1e-13)  # round-off
    assert squares.gradient(np.array([x, y])) == pytest.approx(
        [2 * (r[0] + y * r[2]), 2 * (r[1] + x * r[2])], rel=1e-12
    )
    mixed = 2 * (x * y + r[2])
    assert squares.hessian(np.array([x, y])) == pytest.approx(
        np.array([[2 + 2 * y**2, mixed], [mixed, 2 + 2 * x**2]]), rel=1e-11
    )


def test_scatter_of_the_nodes_moves_the_papers_minimum_further_and_intervals_know():
    rng, errors, inside = np.random.default_rng(8), {s: [] for s in Surrogate}, {s: [] for s in Surrogate}
    for _ in range(30):
        truth = CENTRE * rng.uniform(0.9, 1.1, 2)
        shaken = replace(SIMULATED, load=SIMULATED.load * (1 + 0.01 * rng.standard_normal(SIMULATED.load.shape)))
        data = measured(tuple(truth), rng)
        for surrogate in Surrogate:
            found = estimate(GRID, shaken, data, Settings(Objective.LOAD, 0.0, surrogate=surrogate))
            if found.interior and found.minimum.convex:
                errors[surrogate].append(np.abs(found.minimum.position / truth - 1))
            if found.uncertainty is not None:
                low, high = np.transpose([found.uncertainty.f_max, found.uncertainty.delta_max])
                inside[surrogate].append((low <= truth) & (truth <= high))
    assert len(inside[Surrogate.DATA]) >= 28  # nothing of it is refused but what chance puts outside
    paper, ours = (np.median(errors[s], axis=0) for s in (Surrogate.OBJECTIVE, Surrogate.DATA))
    assert np.all(ours < 0.8 * paper)  # seen: 0.8 and 0.5 % against 1.1 and 1.2 %
    assert np.mean(inside[Surrogate.DATA]) >= 0.86  # 95 % of 60, three standard errors
