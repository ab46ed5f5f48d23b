"""Rectangles of one material pulled along their rows, and their answer to a step and a ramp in closed form."""

from __future__ import annotations

import numpy as np

from pipeline.core.clock import Clock
from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import BondLaw, Gauge, Grip, Kinematics, Problem, Role
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.core.units import GPA, MM
from pipeline.materials.burgers import Burgers
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.relaxation import arms

BEAM = SingleEdgeNotchedBeam(depth=60 * MM, span=130 * MM, length=137 * MM, thickness=40 * MM, notch_length=15 * MM)
MASTIC = Burgers(0.1 / GPA, 0.04 / GPA, 1500 * GPA, 15.0)
STEP, DURATION = 2e-6, 60.0  # m, and s in which the same opens once more
STIFFNESS = 4e8  # N/m at once


def creeping_bonds(count: int, f_max: float = 2000.0, delta_max: float = 1e-4) -> CreepingSoftening:
    """Bonds of MASTIC; at the default strength (N) no patch is damaged."""
    rise = arms(MASTIC.relaxation(), np.full(count, STIFFNESS * MASTIC.d1))
    return CreepingSoftening(rise, np.full(count, f_max), np.full(count, delta_max))


def patch(columns: int, rows: int) -> Problem:
    """Creeping bonds between two ends; the right one is pulled by STEP at once, then by as much again in DURATION.

    One row is a chain. The gauge reads the motion of the machine.
    """
    radius = 1 * MM
    line, place = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    x = (2 * radius * (place + 0.5 * (line % 2))).ravel()
    position = np.column_stack([x, (np.sqrt(3) * radius * line).ravel()])
    distance = np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1))
    pairs = np.argwhere(np.triu(distance < 2.1 * radius, 1)).astype(np.int32)
    n, m = len(position), len(pairs)
    left, right = (np.flatnonzero(place.ravel() == k) for k in (0, columns - 1))
    ends = _grip("left", left, (-1.0, 0.0), 0.0, Role.REACT), _grip("right", right, (1.0, 0.0), 1.0, Role.DRIVE)
    law: BondLaw = creeping_bonds(m)
    return Problem(
        specimen=BEAM,
        particles=Particles(position, 0.5 * MM, np.full(n, Phase.MASTIC, np.uint8), np.zeros(n, np.int32)),
        bonds=Bonds(pairs, np.full(m, Phase.MASTIC, np.uint8), np.zeros(m, bool)),
        law=law,
        grips=(*ends, *(_grip(f"line_{i}", np.array([i]), (0.0, 1.0), 0.0, Role.GUIDE) for i in _held(columns, rows))),
        gauge=Gauge(
            np.append(right, left), np.append(np.full(right.size, 1 / right.size), np.full(left.size, -1 / left.size))
        ),
        kinematics=Kinematics.SMALL,
        cmod_max=2 * STEP,
        stations=STEP * np.array([1.0, 1.2, 1.5, 1.9]),
        cmod_rate=STEP / DURATION,
        clock=Clock(np.array([0.0, STEP, 2 * STEP]), np.array([0.0, 1e-9 * DURATION, DURATION])),
    )


def relaxed(cmod: np.ndarray) -> np.ndarray:
    """Load over that of a patch that does not creep, after the step: (E(t) + ∫₀ᵗ E ds/T)/(E(0)(1 + t/T)).

    All of the patch has the same E(t) and Poisson's ratio, so its load is a fixed share of one bond's.
    """
    time = DURATION * (cmod / STEP - 1)
    series = MASTIC.relaxation()
    fall = np.exp(-np.divide.outer(time, series.time))
    load = fall @ series.modulus + (1 - fall) @ (series.modulus * series.time) / DURATION
    return MASTIC.d1 * load * STEP / cmod


def _held(columns: int, rows: int) -> list[int]:
    """Particles held across the rows: all of a chain, which has no stiffness there, else two against turning."""
    return list(range(columns)) if rows == 1 else [0, columns - 1]


def _grip(name: str, index: np.ndarray, direction: tuple[float, float], drive: float, role: Role) -> Grip:
    return Grip(name, index, np.full(index.size, 1 / index.size), np.array(direction), drive, role)
