"""A test whose displacements are linear in the parameters: Φ is a paraboloid, all statistics are known."""

from __future__ import annotations

import numpy as np

from pipeline.core.field import DisplacementField
from pipeline.inverse.design import Design
from pipeline.inverse.newton import minimise
from pipeline.inverse.objective import Comparison, Objective, Rigid, compare, differences
from pipeline.inverse.observations import Measured, Simulated
from pipeline.inverse.surrogate import LagrangeSurrogate
from pipeline.inverse.uncertainty import Fit

from .hinge import CENTRE, LOAD_NOISE, NOISE, POINTS, STATIONS, field, load

TRUTH = (73.0, 1.10e-4)
WIDE = (0.2, 0.6, 1.0, 1.4, 1.8)  # no fit of a linear model ever ends on its edge
GRID = Design(CENTRE, WIDE, WIDE)


def _slopes(function) -> list[np.ndarray]:
    f, d = CENTRE
    return [
        (function(1.01 * f, d) - function(0.99 * f, d)) / (0.02 * f),
        (function(f, 1.01 * d) - function(f, 0.99 * d)) / (0.02 * d),
    ]


def linear(function, f_max: float, delta_max: float) -> np.ndarray:
    """The hinge model's plane at the grid's centre."""
    by_f, by_d = _slopes(function)
    return function(*CENTRE) + by_f * (f_max - CENTRE[0]) + by_d * (delta_max - CENTRE[1])


SIMULATED = Simulated.of(GRID, [linear(field, *n) for n in GRID.nodes()], [linear(load, *n) for n in GRID.nodes()])


def measured(field_error: np.ndarray, load_error: np.ndarray, load_gain: float = 1.0, truth=TRUTH) -> Measured:
    """The truth with the given errors; the stated noise is that of the hinge model."""
    data = DisplacementField(
        POINTS, linear(field, *truth) + field_error, np.ones((10, 16), bool), np.full((10, 16), NOISE), STATIONS
    )
    return Measured(STATIONS, data, load_gain * linear(load, *truth) + load_error, np.full(10, LOAD_NOISE))


def white(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    return NOISE * rng.standard_normal((10, 16, 2)), LOAD_NOISE * rng.standard_normal(10)


def comparison(data: Measured, objective: Objective, rigid: Rigid = Rigid.FIT) -> Comparison:
    return compare(data, SIMULATED, objective, rigid)


def fit(data: Measured, objective: Objective, rigid: Rigid = Rigid.FIT) -> Fit:
    """The optimum, from one start as Φ is a paraboloid."""
    compared = comparison(data, objective, rigid)
    phi, features = differences(compared, SIMULATED)
    lines = GRID.f_max, GRID.delta_max
    surrogate = LagrangeSurrogate(*lines, phi)
    best = minimise(surrogate, np.array([CENTRE]))[0]
    assert SIMULATED.load is not None
    return Fit(
        compared, surrogate, LagrangeSurrogate(*lines, features), LagrangeSurrogate(*lines, SIMULATED.load), best
    )
