"""A photograph as the ground of a drawing: in pixels as it was taken, with a scale bar instead of axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, Normalize

from pipeline.core.units import MM
from pipeline.dic.correlation import Correlation
from pipeline.dic.crack import Crack
from pipeline.report.style import BLACK


def photograph_axes(axes: Axes, picture: np.ndarray, metre_per_px: float, dim: float = 0.0) -> None:
    """A photograph as it was taken, its levels stretched, with a scale bar and no axes.

    Parameters
    ----------
    axes : Axes
    picture : (rows, columns) array, grey values
    metre_per_px : float, m
    dim : float, 0 to 1; how far it fades to white, for something drawn upon it
    """
    axes.imshow(dim + (1 - dim) * stretched(picture), cmap="gray", vmin=0, vmax=1, interpolation="antialiased")
    rows, columns = picture.shape
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    bare(axes)
    scale_bar(axes, metre_per_px, columns)


def bare(axes: Axes) -> None:
    """No ticks, no frame, square pixels."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    axes.set_aspect("equal")


def scale_bar(axes: Axes, metre_per_px: float, columns: int) -> None:
    """A bar of a round length under the picture."""
    wanted = 0.2 * columns * metre_per_px / MM
    power = 10 ** np.floor(np.log10(wanted))
    length = float(power * max(n for n in (1, 2, 5) if n * power <= wanted))
    width = length * MM / metre_per_px / columns
    place = axes.transAxes
    axes.plot([0, width], [-0.03, -0.03], color=BLACK, linewidth=2, transform=place, clip_on=False, zorder=6)
    axes.text(width + 0.012, -0.03, f"{length:g} mm", transform=place, va="center", fontsize=7)


def stretched(picture: np.ndarray) -> np.ndarray:
    """Grey values from 0 to 1, but for the darkest and brightest few."""
    low, high = np.quantile(picture, [0.002, 0.998])
    return np.clip((picture - low) / max(high - low, 1e-12), 0, 1)


def paint(axes: Axes, result: Correlation, values: np.ndarray, cmap: str | Colormap, norm: Normalize) -> QuadMesh:
    """Cells of the grid in colour; returns what a colour bar needs."""
    column, row = (_edges(v) for v in (result.grid.columns, result.grid.rows))
    cells = np.ma.masked_invalid(values.reshape(result.grid.shape))
    return axes.pcolormesh(column, row, cells, cmap=cmap, norm=norm, alpha=0.88, linewidth=0, rasterized=True)


def _edges(nodes: np.ndarray) -> np.ndarray:
    """Borders of the cells around nodes."""
    step = nodes[1] - nodes[0] if nodes.size > 1 else 1
    return np.append(nodes, nodes[-1] + step) - step / 2


def draw_path(axes: Axes, crack: Crack | None, colour: str = BLACK) -> None:
    """The way of a crack and its tip, on a light rim."""
    if crack is None:
        return
    axes.plot(*crack.path.T, color="white", linewidth=1.8, solid_capstyle="round")
    axes.plot(*crack.path.T, color=colour, linewidth=0.8, solid_capstyle="round")
    if not crack.through:
        axes.plot(*crack.tip, "o", color=colour, markersize=3, markeredgecolor="white", markeredgewidth=0.6)
