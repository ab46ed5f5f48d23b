"""Small beams with known phases, as problems for any engine."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from pipeline.core.clock import steady
from pipeline.core.particles import Phase
from pipeline.core.problem import Kinematics, Problem
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.core.units import GPA, MM
from pipeline.materials.burgers import Burgers
from pipeline.materials.creeping_mixture import creeping_law
from pipeline.materials.elastic import Plane
from pipeline.materials.mixture import Mixture
from pipeline.microstructure.attachment import attach_gauge, attach_grips
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phase_map import PhaseMap
from pipeline.microstructure.phases import lay_phases
from pipeline.microstructure.placement import ImagePlacement

PAPER = SingleEdgeNotchedBeam(depth=60 * MM, span=130 * MM, length=137 * MM, thickness=40 * MM, notch_length=15 * MM)


def small_beam(
    radius: float = 1.2 * MM,
    *,
    stones: bool = True,
    angle: float = np.pi / 2,
    kinematics: Kinematics = Kinematics.SMALL,
    cmod_max: float = 0.1 * MM,
    accuracy: float = 0.01,
    poissons_ratio: float = 0.25,
    mastic: Burgers | None = None,
    **options: Any,
) -> Problem:
    """The paper's SE(B) with round stones on a grid, or all mastic, at f_max/(2 r t) of 71 N at 0.3 mm.

    `options` are those of a mixture; with `mastic` the bonds creep, by the clock of a test at 0.5 mm/min.
    """
    packing = hexagonal_packing(PAPER, radius, angle)
    particles, bonds, _ = lay_phases(PAPER, packing, stone_rows() if stones else None)
    f_max, delta_max = 71.0 * radius / (0.3 * MM), 1.14e-4
    mixture = Mixture(10 * GPA, 50 * GPA, poissons_ratio, Plane.STRAIN, f_max, delta_max, **options)
    law = mixture.law if mastic is None else partial(creeping_law, mixture, mastic)
    return Problem(
        specimen=PAPER,
        particles=particles,
        bonds=bonds,
        law=law(bonds, PAPER.thickness, f_max, delta_max),
        grips=attach_grips(PAPER, particles),
        gauge=attach_gauge(PAPER, particles),
        kinematics=kinematics,
        cmod_max=cmod_max,
        stations=np.linspace(0.2, 0.9, 8) * cmod_max,
        accuracy=accuracy,
        cmod_rate=0.5e-3 / 60,
        clock=None if mastic is None else steady(0.5e-3 / 60),
    )


def stone_rows(pitch: float = 11 * MM, diameter: float = 8 * MM, mm_per_px: float = 0.2) -> PhaseMap:
    """Round stones in staggered rows, clear of the notch line."""
    x0, y0, x1, y1 = PAPER.bounds
    pixel = mm_per_px * MM
    columns, rows = np.meshgrid(
        np.arange(x0 - pixel, x1 + 2 * pixel, pixel), np.arange(y1 + pixel, y0 - 2 * pixel, -pixel)
    )
    row = np.floor(rows / pitch)
    shift = 0.5 * pitch * (row % 2)
    column = np.floor((columns - shift) / pitch)
    arm = np.hypot(columns - shift - (column + 0.5) * pitch, rows - (row + 0.5) * pitch)
    inside = arm < diameter / 2
    number = (row * 1000 + column).astype(np.int64)
    _, stone = np.unique(np.where(inside, number, -(10**9)), return_inverse=True)
    label = np.where(inside, Phase.AGGREGATE, Phase.MASTIC).astype(np.uint8)
    origin = (-float(columns[0, 0]) / pixel, float(rows[0, 0]) / pixel)
    return PhaseMap(label, stone.reshape(label.shape).astype(np.int32), ImagePlacement(pixel, origin, 0.0, False))
