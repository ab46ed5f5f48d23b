"""Hexagonal packing: particle centres on a triangular lattice inside a specimen, and the bonds between neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.specimen import Specimen, crosses_notch

LARGEST_COUNT = 5_000_000
"""Particles; more is taken for a slip in the units of the radius."""

FEWEST_ACROSS = 6
"""Particle spacings that the ligament must hold, for a crack to have a path at all."""

PLASTIC = 1.324717957244746
"""The real root of g³ = g + 1."""


@dataclass(frozen=True)
class Packing:
    """Centres and neighbours, before anything is known of phases.

    Parameters
    ----------
    position : (n, 2) array, m; specimen coordinates, line by line of the lattice
    pairs : (m, 2) int32 array; bonded particles, first < second, sorted
    radius : float, m; neighbours are two radii apart
    angle : float, rad; direction of a close-packed row against x
    """

    position: np.ndarray
    pairs: np.ndarray
    radius: float
    angle: float


@dataclass(frozen=True)
class Lattice:
    """A triangular lattice, laid so that the notch line runs between its points.

    The origin of the specimen is the midpoint of that bond whose direction lies in [30°, 90°), so the
    lattice is point-symmetric about the notch mouth. With rows along y (90°) its columns lie at
    x = ±(√3/2)(2k + 1) r and the lowest centres at r/2 and 3r/2 above the mouth; with rows along x (0°) its
    rows lie at y = (√3/2)(2k + 1) r and no centre is closer to the notch line than r/2.

    Parameters
    ----------
    radius : float, m
    angle : float, rad; direction of a close-packed row against x, the same every 60°
    shift : (2,) array-like, m; by which the whole lattice is moved from there
    """

    radius: float
    angle: float
    shift: tuple[float, float] = (0.0, 0.0)

    @property
    def directions(self) -> tuple[float, float]:
        """Direction (rad) of the lines, the row nearest to y in [60°, 120°), and of the step to the next, 60° below."""
        line = np.pi / 3 + _modulo(self.angle, np.pi / 3)
        return line, line - np.pi / 3

    @property
    def basis(self) -> np.ndarray:
        """(2, 2) array, m; rows are the steps along a line and to the next line."""
        turn = np.array(self.directions)
        return 2 * self.radius * np.column_stack([np.cos(turn), np.sin(turn)])

    @property
    def origin(self) -> np.ndarray:
        """(2,) array, m; the lattice point nearest to the notch mouth."""
        turn = np.pi / 6 + _modulo(self.angle - np.pi / 6, np.pi / 3)
        return self.radius * np.array([np.cos(turn), np.sin(turn)]) + self.shift

    def points(self, bounds: tuple[float, float, float, float]) -> np.ndarray:
        """Points (lines, places, 2) in m that cover a rectangle x0, y0, x1, y1, and some around it."""
        x0, y0, x1, y1 = bounds
        corners = np.array([(x0, y0), (x1, y0), (x0, y1), (x1, y1)])
        index = (corners - self.origin) @ np.linalg.inv(self.basis)
        low, high = np.floor(index.min(axis=0)).astype(int), np.ceil(index.max(axis=0)).astype(int)
        place, line = (np.arange(a, b + 1, dtype=float) for a, b in zip(low, high, strict=True))
        along, aside = self.basis
        return self.origin + line[:, None, None] * aside + place[None, :, None] * along

    def placements(self, count: int) -> list[tuple[float, float]]:
        """Shifts (m) that spread evenly over the lattice's cell; none of them is zero.

        The fractional parts of k/g and k/g², g the real root of g³ = g + 1, fill the unit square more evenly than
        chance (Roberts 2018), whatever their number.
        """
        steps = np.arange(1, count + 1)[:, None] / PLASTIC ** np.array([1, 2])
        return [(float(x), float(y)) for x, y in ((steps + 0.5) % 1 - 0.5) @ self.basis]


def hexagonal_packing(
    specimen: Specimen, radius: float, angle: float = np.pi / 2, shift: tuple[float, float] = (0.0, 0.0)
) -> Packing:
    """Lay particles on a triangular lattice over a specimen and bond nearest neighbours.

    A particle is kept where its centre is in the specimen; a bond where it crosses neither the notch nor a
    hole (Hill et al. 2017, Fig. 7; Kim et al. 2009).

    Parameters
    ----------
    specimen : Specimen
    radius : float, m
    angle : float, rad; direction of close-packed rows against x
    shift : (2,), m; by which the lattice is moved from where it lies even to the notch line

    Raises
    ------
    InputError
        for a radius that is not positive, too large for the ligament, or so small that more than
        `LARGEST_COUNT` particles would be needed
    """
    _check(specimen, radius, angle)
    points = Lattice(radius, angle, shift).points(specimen.bounds)
    inside = specimen.contains(points.reshape(-1, 2)).reshape(points.shape[:2])
    number = np.full(inside.shape, -1, np.int32)
    number[inside] = np.arange(np.count_nonzero(inside), dtype=np.int32)
    position = points[inside]
    pairs = _neighbours(number)
    start, end = position[pairs[:, 0]], position[pairs[:, 1]]
    cut = crosses_notch(specimen, start, end) | _leaves(specimen, start, end)
    return Packing(position, pairs[~cut], radius, angle)


def _neighbours(number: np.ndarray) -> np.ndarray:
    """Pairs (m, 2) of the six nearest neighbours in a table of lines and places; −1 is an empty place."""
    views = (
        (number[:, :-1], number[:, 1:]),  # along the line
        (number[:-1], number[1:]),  # to the next line
        (number[:-1, 1:], number[1:, :-1]),  # to the next line, one place back
    )
    pairs = np.concatenate([np.column_stack([a[k], b[k]]) for a, b in views for k in [(a >= 0) & (b >= 0)]])
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def _leaves(specimen: Specimen, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Which segments, each (m, 2), leave the specimen between their ends, looked at in eight equal steps."""
    out = np.zeros(len(start), bool)
    for share in np.arange(1, 8) / 8:
        out |= ~specimen.contains(start + share * (end - start))
    return out


def _modulo(angle: float, period: float) -> float:
    """The angle in [0, period), where an angle short of the period by round-off counts as 0."""
    rest = angle % period
    return 0.0 if period - rest < 1e-9 else rest


def _check(specimen: Specimen, radius: float, angle: float) -> None:
    if not (0 < radius < np.inf and np.isfinite(angle)):
        raise InputError(
            f"particle_radius_mm = {radius * 1e3:g} must be positive, and lattice_angle_deg = {np.rad2deg(angle):g} "
            "finite"
        )
    if specimen.ligament_length < FEWEST_ACROSS * 2 * radius:
        raise InputError(
            f"particle_radius_mm = {radius * 1e3:g} is too large: the ligament of {specimen.ligament_length * 1e3:g} "
            f"mm must hold at least {FEWEST_ACROSS} particles of {2e3 * radius:g} mm"
        )
    x0, y0, x1, y1 = specimen.bounds
    count = (x1 - x0) * (y1 - y0) / (2 * 3**0.5 * radius**2)
    if count > LARGEST_COUNT:
        raise InputError(
            f"particle_radius_mm = {radius * 1e3:g} asks for about {count:.2g} particles, at most {LARGEST_COUNT:.0e} "
            "are taken: check the unit, or use a larger radius"
        )
