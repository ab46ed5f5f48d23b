"""Where machine and clip gauge touch the particles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.interpolation import plane_weights
from pipeline.core.particles import Particles
from pipeline.core.problem import Gauge, Grip, Role
from pipeline.core.specimen import GripRegion, Specimen

FEWEST_GRIPPED = 3
"""Particles that a grip needs, for its force to be spread at all."""

GAUGE_SPACINGS = 4
"""Depth, in particle spacings, of the patch whose plane gives the displacement of a gauge point."""


WIDENING = (1.0, 1.25, 1.5, 2.0)
"""How much deeper a grip region may become where voids leave it without a sound hold."""


def attach_grips(specimen: Specimen, particles: Particles) -> tuple[Grip, ...]:
    """Turn the specimen's grip regions into weights on particles.

    Weights are equal, then corrected by the smallest change (least squares) that brings their mean x to
    the anchor, so that the force has its exact line of action; none is negative. Where voids leave a
    region too few particles, or all on one side, it is deepened up to twofold.

    Raises
    ------
    InputError
        if even the deepened region holds too few particles, or only on one side of its anchor
    """
    return attach_regions(specimen.grip_regions(particles.radius), particles)


def attach_regions(regions: Iterable[GripRegion], particles: Particles) -> tuple[Grip, ...]:
    """The same for grip regions that are given."""
    return tuple(_grip(region, particles) for region in regions)


def _grip(region: GripRegion, particles: Particles) -> Grip:
    problem = ""
    for factor in WIDENING:
        depth = region.inner + factor * (region.outer - region.inner)
        index = np.flatnonzero(replace(region, outer=depth).contains(particles.position))
        weight = _balanced(particles.position[index, 0], region.anchor_x)
        if index.size >= FEWEST_GRIPPED and weight.min() >= 0:
            return Grip(region.name, index, weight, np.array(region.direction, float), region.drive, Role(region.role))
        problem = problem or _problem(region, particles.position[index, 0])
    raise InputError(problem)


def _problem(region: GripRegion, x: np.ndarray) -> str:
    where = f"the grip {region.name!r} at {_mm(region.centre)} mm"
    if x.size < FEWEST_GRIPPED:
        return (
            f"{where} touches {x.size} particles, at least {FEWEST_GRIPPED} are needed: use a smaller particle radius, "
            "or check for a void there"
        )
    anchor = np.nan if region.anchor_x is None else region.anchor_x * 1e3
    return (
        f"{where} touches particles from x = {x.min() * 1e3:.3g} to {x.max() * 1e3:.3g} mm, too much to one side for "
        f"its force to act at x = {anchor:g} mm: keep the roller away from the specimen's end, check for a void there, "
        "or use a smaller particle radius"
    )


def _balanced(x: np.ndarray, anchor: float | None) -> np.ndarray:
    """Weights summing to 1, of smallest norm, with their mean x at the anchor where there is one."""
    if x.size == 0 or anchor is None:
        return np.full(x.size, 1 / max(x.size, 1))
    arm = x - x.mean()
    spread = float(np.sum(arm**2))
    return 1 / x.size + (anchor - x.mean()) / spread * arm if spread > 0 else np.full(x.size, -1.0)


def attach_gauge(specimen: Specimen, particles: Particles) -> Gauge:
    """Turn the clip gauge into weights on the particles of both notch flanks.

    On each flank a plane is fitted to the particles around the gauge point (`core.interpolation`), so that
    rigid rotation and uniform strain of a flank are read exactly, also by knife edges outside the specimen
    (gauge_y < 0). The patch reaches `GAUGE_SPACINGS` beyond the particle nearest to the gauge point, so it
    moves into the material where there is a void; nothing beyond the notch tip is taken.

    Raises
    ------
    InputError
        if a flank has too few particles around its gauge point
    """
    index, weight = [], []
    for side in (1, -1):
        flank, point, _ = _flank(specimen, particles, side)
        arm = np.hypot(*(particles.position[flank] - point).T)
        reach = arm.min() + GAUGE_SPACINGS * 2 * particles.radius
        near = flank[arm < reach]
        index.append(near)
        weight.append(side * plane_weights(particles.position[near], point, reach))
    return Gauge(np.concatenate(index), np.concatenate(weight))


def gauge_remark(specimen: Specimen, particles: Particles) -> str | None:
    """One sentence where a gauge point has no particle near it (a void at the mouth); None where all is well."""
    remarks = []
    for side, name in ((1, "right"), (-1, "left")):
        _, point, distance = _flank(specimen, particles, side)
        outside = max(-specimen.gauge_y, 0.0)
        if distance > outside + 4 * particles.radius:
            remarks.append(
                f"the {name} gauge point at {_mm(point)} mm lies in a void: its displacement is carried over from "
                f"particles {distance * 1e3:.2g} mm away"
            )
    return "; ".join(remarks) or None


def _flank(specimen: Specimen, particles: Particles, side: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Particles of one flank below the notch tip, its gauge point (2,), and the distance of the nearest, m."""
    x, y = particles.position.T
    flank = np.flatnonzero(((x >= 0) == (side > 0)) & (y < specimen.tip[1]))
    if flank.size == 0:
        raise InputError(
            "a notch flank has no particles below the tip: check notch_length_mm, the image and the radius"
        )
    point = np.array([side * specimen.gauge_length / 2, specimen.gauge_y])
    return flank, point, float(np.hypot(*(particles.position[flank] - point).T).min())


def _mm(point: np.ndarray | tuple[float, float]) -> str:
    return f"({point[0] * 1e3:g}, {point[1] * 1e3:g})"
