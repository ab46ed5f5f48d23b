"""The objective over the grid of parameters (Hill et al. 2017, Figs. 12 and 13, seen from above)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.patches import Ellipse
from matplotlib.ticker import LogLocator, MaxNLocator

from pipeline.core.units import UM
from pipeline.inverse.estimate import Estimate
from pipeline.inverse.objective import Objective
from pipeline.report.style import BLACK, OPTIMUM, colour_bar

CHI_SQUARE_2D_95 = 5.991  # 95 % of a normal pair lie inside this squared radius


def objective_surface(axes: Axes, found: Estimate, resolution: int = 201) -> Axes:
    """Level lines of what was minimised, the nodes, the optimum and its 95 % region.

    Colour is the root of Φ per datum where that has a meaning (µm for fields, noise units otherwise); the
    dashed line joins parameters of the optimum's fracture energy.

    Parameters
    ----------
    axes : Axes
    found : Estimate
    resolution : int; raster lines a side
    """
    design = found.design
    f_max = np.linspace(design.f_max[0], design.f_max[-1], resolution)
    delta_max = np.linspace(design.delta_max[0], design.delta_max[-1], resolution)
    height, label = _per_datum(found, found.valley.on_grid(f_max, delta_max))
    levels = _levels(height)
    norm = LogNorm(levels[0], levels[-1])
    height = np.maximum(height, levels[0])
    filled = axes.contourf(f_max, delta_max / UM, height.T, levels=levels, norm=norm, cmap="viridis", extend="both")
    axes.contour(f_max, delta_max / UM, height.T, levels=levels[::2], colors="white", linewidths=0.4, alpha=0.6)
    side = colour_bar(axes, filled, label)
    side.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)) if levels[-1] > 3 * levels[0] else MaxNLocator(6))
    side.yaxis.set_major_formatter("{x:g}")
    side.minorticks_off()
    _marks(axes, found, f_max, delta_max)
    axes.set(xlabel="$f_\\mathrm{max}$ (N)", ylabel="$\\delta_\\mathrm{max}$ (µm)")
    return axes


def _marks(axes: Axes, found: Estimate, f_max: np.ndarray, delta_max: np.ndarray) -> None:
    """Nodes, optimum, its region and the line of constant energy."""
    nodes = np.array(found.design.nodes())
    axes.plot(
        nodes[:, 0], nodes[:, 1] / UM, "o", markersize=3, color="white", markeredgecolor=BLACK, label="simulations"
    )
    energy = found.f_max * found.delta_max / f_max
    inside = (energy >= delta_max[0]) & (energy <= delta_max[-1])
    axes.plot(f_max[inside], energy[inside] / UM, "--", color="white", linewidth=0.9, label="same fracture energy")
    if found.uncertainty is not None:
        axes.add_patch(_region(found))
    axes.plot(
        found.f_max,
        found.delta_max / UM,
        "*",
        markersize=11,
        color=OPTIMUM,
        markeredgecolor="white",
        markeredgewidth=0.7,
        label="optimum" if found.interior else "best on the edge",
        zorder=5,
    )
    step = [0.03 * (a[-1] - a[0]) for a in (f_max, delta_max / UM)]
    axes.set_xlim(f_max[0] - step[0], f_max[-1] + step[0])
    axes.set_ylim(delta_max[0] / UM - step[1], delta_max[-1] / UM + step[1])
    legend = axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, columnspacing=2.0, handlelength=1.6)
    for line in legend.get_lines():
        if line.get_linestyle() == "--":
            line.set_color(BLACK)


def _region(found: Estimate) -> Ellipse:
    """The region that holds both parameters with 95 % together, within normal theory."""
    assert found.uncertainty is not None
    unit = np.array([1.0, 1 / UM])
    size, turn = np.linalg.eigh(found.uncertainty.covariance * np.outer(unit, unit))
    width, height = 2 * np.sqrt(CHI_SQUARE_2D_95 * np.clip(size, 0, None))
    angle = np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))
    style = {"fill": False, "edgecolor": OPTIMUM, "linewidth": 1.2, "label": "95 % region"}
    return Ellipse((found.f_max, found.delta_max / UM), width, height, angle=angle, **style)


def _per_datum(found: Estimate, height: np.ndarray) -> tuple[np.ndarray, str]:
    """Root of the objective per vector or datum, and what it is called."""
    if found.settings.objective is Objective.FIELDS:
        vectors = found.comparison.use_field.sum()
        return np.sqrt(np.clip(height, 0, None) / vectors) / UM, "$\\sqrt{P/n}$, difference of displacement (µm)"
    return np.sqrt(np.clip(height, 0, None) / found.comparison.size), "$\\sqrt{P/n}$, difference over noise"


def _levels(height: np.ndarray) -> np.ndarray:
    """Positive levels in equal ratios, not finer near zero than a hundredth of the range."""
    top = max(float(height.max()), 1e-9)
    bottom = float(np.clip(height.min(), top / 100, top / 1.001))
    return np.geomspace(bottom, top, 17)
