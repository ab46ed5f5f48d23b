"""Displacements: measured against simulated at the observation points, and over the whole specimen."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import CenteredNorm, Normalize

from pipeline.core.field import rigid_motion
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM, UM
from pipeline.report.style import BLACK, GREY, MEASURED, SIMULATED, SKY, colour_bar, disks, outline, specimen_axes


def displacement_vectors(
    axes: Axes,
    specimen: Specimen,
    points: np.ndarray,
    measured: np.ndarray,
    simulated: np.ndarray,
    valid: np.ndarray,
    cmod: float,
    fit_rigid: bool,
) -> Axes:
    """Measured and simulated displacement at every point of one station, as arrows from the point.

    Parameters
    ----------
    axes : Axes
    specimen : Specimen
    points : (p, 2) array, m
    measured, simulated : (p, 2) arrays, m
    valid : (p,) bool array; points that were compared
    cmod : float, m
    fit_rigid : bool; the rigid motion of each is taken out, as in the objective
    """
    if fit_rigid and valid.sum() >= 3:
        measured, simulated = (u - rigid_motion(points, u, valid) for u in (measured, simulated))
    at = points[valid] / MM
    longest = max(float(np.hypot(*measured[valid].T).max(initial=0)), 1e-12)
    scale = longest / (0.16 * np.ptp(points[:, 0])) if np.ptp(points[:, 0]) else longest
    for values, colour, width, label in (
        (measured, MEASURED, 0.011, "measured"),
        (simulated, SKY, 0.005, "simulated"),
    ):
        u = values[valid] / scale / MM
        style: dict[str, Any] = {
            "angles": "xy",
            "scale_units": "xy",
            "scale": 1,
            "width": width,
            "headwidth": 3.2,
            "headlength": 3.6,
        }
        axes.quiver(*at.T, *u.T, color=colour, label=label, zorder=3, **style)
    axes.plot(*at.T, ".", color=GREY, markersize=2.5)
    axes.plot(*(points[~valid] / MM).T, "x", color=GREY, markersize=4)
    _key(axes, points / MM, longest, scale)
    _notch(axes, specimen)
    axes.set_title(f"CMOD {cmod / MM:.2f} mm")
    return axes


def difference_by_station(
    axes: Axes, cmod: np.ndarray, measured: np.ndarray, simulated: np.ndarray, valid: np.ndarray, noise: float
) -> Axes:
    """Root mean square difference of the displacement vectors at every station, against the noise.

    Parameters
    ----------
    axes : Axes
    cmod : (s,) array, m
    measured, simulated : (s, p, 2) arrays, m, rigid motion already taken out where it shall be
    valid : (s, p) bool array
    noise : float, m; standard deviation of one component
    """
    square = np.where(valid, np.sum((measured - simulated) ** 2, axis=-1), 0.0).sum(axis=1)
    count = valid.sum(axis=1)
    rms = np.sqrt(np.divide(square, count, out=np.full(len(cmod), np.nan), where=count > 0))
    axes.plot(cmod / MM, rms / UM, "o-", color=SIMULATED, markersize=4, label="measured − simulated, rms vector")
    axes.axhline(np.sqrt(2) * noise / UM, color=GREY, linestyle="--", linewidth=0.9, label="noise of the measurement")
    axes.set(xlabel="CMOD (mm)", ylabel="difference of displacement (µm)")
    axes.set_ylim(bottom=0)
    axes.legend()
    return axes


def displacement_map(
    axes: Axes, specimen: Specimen, position: np.ndarray, radius: float, displacement: np.ndarray, component: int
) -> Axes:
    """One component of the displacement of every particle: nothing is interpolated across the crack.

    Parameters
    ----------
    axes : Axes
    specimen : Specimen
    position : (n, 2) array, m
    radius : float, m
    displacement : (n, 2) array, m
    component : 0 for u, 1 for v
    """
    values = displacement[:, component] / UM
    both_ways = values.min() < 0 < values.max() and min(-values.min(), values.max()) > 0.2 * np.abs(values).max()
    norm = CenteredNorm() if both_ways else Normalize(values.min(), values.max())
    painted = disks(axes, position, radius, array=values, cmap="RdBu_r" if both_ways else "cividis", norm=norm)
    outline(axes, specimen)
    specimen_axes(axes, specimen.bounds, margin=2 * MM)
    name = ("u_x", "u_y")[component]
    colour_bar(axes, painted, f"${name}$ (µm)")
    return axes


def _notch(axes: Axes, specimen: Specimen) -> None:
    tip = specimen.tip[1] / MM
    bottom = axes.get_ylim()[0]
    if bottom < tip:
        axes.plot([0, 0], [bottom, tip], color=BLACK, linewidth=2.2, solid_capstyle="butt", zorder=1)


def _key(axes: Axes, points: np.ndarray, longest: float, scale: float) -> None:
    """Limits around the points and an arrow of known length."""
    x, y = points.T
    room = 0.25 * max(np.ptp(x), 1.0)
    left, top = x.min() - 0.8 * room, y.max() + 0.5 * room
    axes.set(xlim=(x.min() - room, x.max() + room), ylim=(y.min() - 0.6 * room, top + 0.6 * room))
    axes.set(xlabel="$x$ (mm)", ylabel="$y$ (mm)")
    axes.set_aspect("equal")
    size = float(f"{longest / UM / 2:.0e}")
    arrow: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "color": GREY}
    axes.quiver(left, top, size * UM / scale / MM, 0, **arrow)
    axes.text(left, top + 0.12 * room, f"{size:g} µm", fontsize=7, color=GREY)
    for row, (name, colour) in enumerate({"measured": MEASURED, "simulated": SKY}.items()):
        axes.text(
            0.99, 0.98 - 0.11 * row, name, color=colour, transform=axes.transAxes, ha="right", va="top", fontsize=7
        )
