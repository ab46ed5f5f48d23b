"""A made-up test: a hinge that opens, whose fields and loads are formulas; with everything a diagnosis needs."""

from __future__ import annotations

import numpy as np

from pipeline.gap.discrepancy import ALL, Discrepancy
from pipeline.gap.observation import Observation, Reading, Sight

PEAK = 0.05e-3
TIP = np.array([0.0, 15e-3])


def sight(columns=(-9.0, -4.5, 4.5, 9.0), rows=(0.0, 1.5, 3.0, 4.5)) -> Sight:
    """The paper's points and stations of SE(B)."""
    x, y = np.meshgrid(columns, rows)
    points = np.column_stack([x.ravel(), y.ravel()]) * 1e-3 + TIP
    cmod = np.concatenate([PEAK * np.array([0.25, 0.5, 0.75]), PEAK + 0.05e-3 * np.arange(10)])
    return Sight(
        cmod=cmod,
        time=cmod / (0.5e-3 / 60),
        points=points,
        side=np.sign(points[:, 0]),
        tip=TIP,
        peak_cmod=PEAK,
        centre=np.array([0.0, 20e-3]),
        corner=32e-3,
        pull=np.array([0.0, -1.0]),
    )


def response(parameters: np.ndarray, at: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Field (k, p, 2), m, and load (k,), N, of a hinge at the CMOD values `at` (k,).

    Two halves turn about a point that moves up with the opening; the load rises and falls. The first parameter scales
    the load and lifts the hinge a little, the second stretches the tail and lifts the hinge more.
    """
    strength, opening = parameters
    height = 45e-3 + 5e-3 * (strength - 1) + 12e-3 * np.tanh(at / (opening * 0.2e-3))
    turn = (at / 2) / height
    side = np.where(points[:, 0] >= 0, 1.0, -1.0)
    arm = height[:, None] - points[:, 1]
    field = np.stack([side * turn[:, None] * arm, side * turn[:, None] * points[:, 0]], axis=-1)
    load = 3000 * strength * (at / PEAK) * np.exp(1 - at / PEAK) * 0.7 + 900 * strength * (
        1 - np.exp(-at / PEAK)
    ) * np.exp(-at / (opening * 0.3e-3))
    return field, load


def discrepancy(level: float = 1.0) -> Discrepancy:
    """A few micrometres and per cent, as two engines differ."""
    amplitude = level * np.full((len(ALL), 3), 2e-6)
    amplitude[-1] = level * 0.03
    return Discrepancy(amplitude, np.eye(len(ALL)), level * np.full(3, 0.5e-6), 0.4e-3, samples=20)


def observed(seen: Sight, reading: Reading, rng: np.random.Generator | None, noise: float = 0.4e-6) -> Observation:
    """A reading with white noise, none where there is no generator; 5 N of the load."""
    field, load = reading.field, reading.load
    if rng is not None:
        field = field + noise * rng.standard_normal(field.shape)
        load = load + 5.0 * rng.standard_normal(load.shape)
    return Observation(seen, Reading(field, load), np.full(field.shape[:2], noise), np.full(load.shape, 5.0))
