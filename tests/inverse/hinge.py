"""A smooth nonlinear fracture test in a few lines: two flanks turning about a hinge that climbs as bonds fail."""

from __future__ import annotations

import numpy as np

from pipeline.core.field import DisplacementField
from pipeline.inverse.design import Design
from pipeline.inverse.observations import Measured, Simulated

CENTRE = (71.0, 1.14e-4)
POINTS = np.array([(x, y) for x in (-9e-3, -4.5e-3, 4.5e-3, 9e-3) for y in (15e-3, 16.5e-3, 18e-3, 19.5e-3)])
STATIONS = 0.05e-3 * np.arange(1, 11)
NOISE = 0.4e-6  # m; 0.01 px
LOAD_NOISE = 5.0  # N


def hinge_height(f_max: float, delta_max: float, cmod: np.ndarray) -> np.ndarray:
    """Where the flanks hinge (m): strong or tough bonds hold it down for longer."""
    strength, toughness = f_max / CENTRE[0], delta_max / CENTRE[1]
    return 57e-3 - 14e-3 * strength**0.8 * np.exp(-cmod / (0.25e-3 * toughness**1.2))


def field(f_max: float, delta_max: float) -> np.ndarray:
    """Displacements (s, p, 2), m."""
    height = hinge_height(f_max, delta_max, STATIONS)[:, None]
    turn = STATIONS[:, None] / (2 * height)
    side = np.sign(POINTS[:, 0])
    return np.stack([side * turn * (height - POINTS[:, 1]), turn * np.abs(POINTS[:, 0])], axis=-1)


def load(f_max: float, delta_max: float) -> np.ndarray:
    """Loads (s,), N."""
    toughness = delta_max / CENTRE[1]
    return 3000 * (f_max / CENTRE[0]) ** 0.9 * np.exp(-STATIONS / (0.2e-3 * toughness))


def simulated(design: Design) -> Simulated:
    nodes = design.nodes()
    return Simulated.of(design, [field(*n) for n in nodes], [load(*n) for n in nodes])


def measured(truth: tuple[float, float], rng: np.random.Generator | None, noise: float = NOISE) -> Measured:
    """A measurement with white noise of the stated size (none where rng is None)."""
    u, p = field(*truth), load(*truth)
    if rng is not None:
        u, p = u + noise * rng.standard_normal(u.shape), p + LOAD_NOISE * rng.standard_normal(p.shape)
    shape = u.shape[:2]
    data = DisplacementField(POINTS, u, np.ones(shape, bool), np.full(shape, noise), STATIONS)
    return Measured(STATIONS, data, p, np.full(p.shape, LOAD_NOISE))
