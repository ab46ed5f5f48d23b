"""A small cracked beam for the figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import Gauge, Kinematics, Problem
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.core.units import MM

BEAM = SingleEdgeNotchedBeam(depth=20 * MM, span=40 * MM, length=44 * MM, thickness=40 * MM, notch_length=5 * MM)
R = 1 * MM


@dataclass(frozen=True)
class Law:
    """Openings of a linear softening law, enough to draw with."""

    f_max: np.ndarray
    delta_max: np.ndarray
    delta_peak: np.ndarray


def lattice() -> tuple[Particles, Bonds]:
    rows = [(x + (j % 2) * R, R + j * np.sqrt(3) * R) for j in range(11) for x in np.arange(-21, 20, 2) * MM]
    position = np.array(rows)
    gap = np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1))
    pairs = np.argwhere(np.triu(gap < 2.1 * R, 1)).astype(np.int32)
    phase = np.where(position[:, 0] > 5 * MM, Phase.AGGREGATE, Phase.MASTIC).astype(np.uint8)
    n, m = len(position), len(pairs)
    return Particles(position, R, phase, np.zeros(n, np.int32)), Bonds(pairs, np.ones(m, np.uint8), np.zeros(m, bool))


def problem() -> Problem:
    particles, bonds = lattice()
    m = bonds.count
    protected = np.arange(m) < 3
    law = Law(np.where(protected, np.inf, 71.0), np.where(protected, np.inf, 1e-4), np.where(protected, np.inf, 1e-6))
    gauge = Gauge(np.array([0]), np.array([0.0]))
    return Problem(BEAM, particles, bonds, law, (), gauge, Kinematics.SMALL, 1e-3, np.array([1e-4]))  # type: ignore[arg-type]
