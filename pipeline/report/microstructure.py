"""The specimen as particles and bonds: phases, and what broke."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.patches import Patch

from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import BondLaw, Problem
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.report.style import BLACK, DAMAGE, PHASE_COLOURS, colour_bar, disks, outline, specimen_axes

NAMES = {Phase.AGGREGATE: "aggregate", Phase.MASTIC: "mastic"}


def phases(axes: Axes, specimen: Specimen, particles: Particles) -> Axes:
    """Every particle as a disk to scale, coloured by its phase; outline and notch.

    Parameters
    ----------
    axes : Axes
    specimen : Specimen
    particles : Particles
    """
    palette = np.array([PHASE_COLOURS.get(k, "#ff00ff") for k in range(max(Phase) + 1)])
    disks(axes, particles.position, particles.radius, facecolors=palette[particles.phase].tolist())
    outline(axes, specimen)
    specimen_axes(axes, specimen.bounds, margin=2 * MM)
    present = [phase for phase in NAMES if np.any(particles.phase == phase)]
    patches = [
        Patch(facecolor=PHASE_COLOURS[p], edgecolor=BLACK, linewidth=0.4, label=_share(particles, p)) for p in present
    ]
    axes.legend(handles=patches, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(patches))
    return axes


def bond_damage(
    axes: Axes,
    problem: Problem,
    reached: np.ndarray,
    displacement: np.ndarray | None = None,
    magnification: float = 1.0,
    window: tuple[float, float, float, float] | None = None,
) -> Axes:
    """How far every bond is along its softening branch, over the stones in pale colour.

    The measure is (κ − δ_peak)/(δ_max − δ_peak), 0 at the peak force and 1 where the bond is broken; the
    secant damage D is 0.99 long before a bond is broken and would show everything as failed.

    Parameters
    ----------
    axes : Axes
    problem : Problem
    reached : (m,) array, m; largest opening κ of every bond
    displacement : (n, 2) array, m, or None; particles are drawn where they went, magnified
    magnification : float
    window : x0, y0, x1, y1 in m, or None for the whole specimen
    """
    particles, shown = problem.particles, softening(problem.law, reached)
    at = particles.position if displacement is None else particles.position + magnification * displacement
    pale = np.where(particles.phase == Phase.AGGREGATE, "#ddd5c4", "#f3f3f3")
    disks(axes, at, particles.radius, facecolors=pale.tolist())
    touched = np.flatnonzero(shown > 0)
    order = touched[np.argsort(shown[touched])]
    middle, edge = _faces(at, problem.bonds, order, particles.radius)
    lines = LineCollection(
        list(np.stack([middle - edge, middle + edge], axis=1) / MM),
        cmap=DAMAGE,
        norm=Normalize(0, 1),
        array=shown[order],
    )
    lines.set(linewidths=1.4, capstyle="round")
    axes.add_collection(lines)
    if displacement is None:
        outline(axes, problem.specimen)
    specimen_axes(axes, window or problem.specimen.bounds, margin=0.0 if window else 2 * MM)
    label = "softening $(\\kappa-\\delta_\\mathrm{peak})/(\\delta_\\mathrm{max}-\\delta_\\mathrm{peak})$"
    colour_bar(axes, ScalarMappable(lines.norm, DAMAGE), label)
    return axes


def softening(law: BondLaw, reached: np.ndarray) -> np.ndarray:
    """(κ − δ_peak)/(δ_max − δ_peak) of every bond (m,), between 0 and 1; 0 where a bond takes no damage."""
    soft = np.isfinite(law.f_max) & np.isfinite(law.delta_max) & (law.delta_max > law.delta_peak)
    peak = np.where(soft, law.delta_peak, 0.0)
    span = np.where(soft, law.delta_max, 1.0) - peak
    return np.where(soft, np.clip((reached - peak) / span, 0, 1), 0.0)


def _faces(at: np.ndarray, bonds: Bonds, which: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Middle of each bond and half the edge between its two cells: cracks are drawn along the faces, as they run."""
    one, two = at[bonds.pairs[which, 0]], at[bonds.pairs[which, 1]]
    across = two - one
    length = np.hypot(across[:, 0], across[:, 1])[:, None]
    normal = np.column_stack([-across[:, 1], across[:, 0]]) / np.where(length > 0, length, 1)
    return (one + two) / 2, normal * radius / np.sqrt(3)


def _share(particles: Particles, phase: Phase) -> str:
    return f"{NAMES[phase]} ({np.mean(particles.phase == phase):.0%})"
