"""From material to bond: what a straight cut through the lattice carries when its halves are moved apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.materials.cohesive import LinearSoftening

LONG = 168 * 2 * np.sqrt(3)  # radii of crack: whole periods across the rows, 291 of 290.985 along them


@dataclass(frozen=True)
class Parting:
    """Halves of a lattice moved apart along the normal of a straight crack, held from sliding.

    Parameters
    ----------
    angle : float, rad; of the crack to the nearest close-packed row
    bonds : float; bonds cut per area, times 2 r t
    strength : float; largest traction over f_max/(2 r t)
    energy : float; work per area over f_max δ_max/(2 r t)
    last_opening : float; opening at which the traction vanishes, over δ_max
    """

    angle: float
    bonds: float
    strength: float
    energy: float
    last_opening: float


def cut_bonds(angle: float, radius: float, length: float) -> np.ndarray:
    """|cos φ| (k,) of the bonds that cross a straight crack of some length (m), φ from its normal.

    Parameters
    ----------
    angle : float, rad; of the crack to a close-packed row
    radius : float, m
    """
    step = 2 * radius
    turns = np.pi / 2 - angle + np.deg2rad([0.0, 60.0, 120.0])  # the crack runs along y
    direction = np.column_stack([np.cos(turns), np.sin(turns)])
    reach = int(length / step * 1.3) + 4
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    # points on the left of the crack, near enough for a bond to cross it; shifted, so that none lies on a line
    points = (i[..., None] * step * direction[0] + j[..., None] * step * direction[1]).reshape(-1, 2)
    points += radius * np.array([0.3714, 0.1237])
    points = points[(points[:, 0] <= 0) & (points[:, 0] > -step)]
    found = []
    for sense in (1, -1):
        for n in sense * direction:
            crossing = points[:, 0] + step * n[0] > 0
            height = points[crossing, 1] - points[crossing, 0] / n[0] * n[1] if n[0] else np.zeros(0)
            found.append(np.full(np.count_nonzero((height >= 0) & (height < length)), abs(n[0])))
    return np.concatenate(found)


def part(angle: float, brittleness: float = 600.0, radius: float = 3e-4, thickness: float = 0.04) -> Parting:
    """Open a straight crack step by step by the law of every bond it cuts.

    Parameters
    ----------
    angle : float, rad
    brittleness : float; δ_max/δ_peak
    radius, thickness : float, m
    """
    f_max, delta_max, length = 71.0, 1.14e-4, LONG * radius
    share, number = np.unique(np.round(cut_bonds(angle, radius, length), 12), return_counts=True)
    law = LinearSoftening(np.array(brittleness * f_max / delta_max), np.array(f_max), np.array(delta_max))
    last = 1.01 / share[share > 1e-9].min()
    opening = np.union1d(np.linspace(0, last, 4001), np.linspace(0, 6 / brittleness, 1201)) * delta_max
    force = sum(n * c * law.force(c * opening, np.zeros(1)) for c, n in zip(share, number, strict=True))
    unit = f_max / (2 * radius * thickness)  # traction
    traction = np.asarray(force) / (length * thickness) / unit
    carries = np.flatnonzero(traction > 1e-9 * traction.max())
    return Parting(
        angle=angle,
        bonds=number.sum() / length * 2 * radius,
        strength=float(traction.max()),
        energy=float(np.trapezoid(traction, opening) / delta_max),
        last_opening=float(opening[min(carries[-1] + 1, opening.size - 1)] / delta_max),
    )


def expected(angle: float) -> Parting:
    """The closed forms: √3 strength in every direction, energy cos(30° − θ)/cos 30°.

    Per area and 2 r t, (2/√3)|cos φ| bonds of each direction are cut and each opens by w|cos φ|.
    """
    cosines = np.abs(np.sin(angle + np.deg2rad([0.0, 60.0, 120.0])))
    cosines = cosines[cosines > 1e-9]
    return Parting(
        angle=angle,
        bonds=float(2 / np.sqrt(3) * cosines.sum()),
        strength=float(np.sqrt(3)),
        energy=float(np.cos(np.pi / 6 - angle) / np.cos(np.pi / 6)),
        last_opening=float(1 / cosines.min()),
    )


def parting_table(angles_deg: Sequence[float] = (0, 10, 20, 30)) -> str:
    """Counted on a lattice and by the closed forms, as a Markdown table."""
    rows = [
        "| crack to rows | bonds cut × 2rt | f_t × 2rt/f_max | G_f × 2rt/(f_max δ_max) | w_c/δ_max |",
        "|---|---|---|---|---|",
    ]
    for degrees in angles_deg:
        found, formula = part(np.deg2rad(degrees)), expected(np.deg2rad(degrees))
        cells = [
            f"{getattr(found, name):.4f} ({getattr(formula, name):.4f})"
            for name in ("bonds", "strength", "energy", "last_opening")
        ]
        rows.append(f"| {degrees:g}° | " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"
