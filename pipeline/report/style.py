"""How every figure looks: size, fonts, colours that the colour-blind can tell apart."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure

from pipeline.core.particles import Phase
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM

MM_PER_INCH = 25.4
DPI = 200

# Okabe and Ito (2008)
BLACK, GREY, LIGHT = "#1a1a1a", "#7a7a7a", "#d4d4d4"
BLUE, SKY, ORANGE, VERMILION, GREEN, PURPLE, YELLOW = (
    "#0072B2",
    "#56B4E9",
    "#E69F00",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#F0E442",
)
MEASURED, SIMULATED, OPTIMUM = BLACK, BLUE, VERMILION

PHASE_COLOURS: Mapping[int, str] = {
    Phase.MASTIC: "#4d4d4d",
    Phase.AGGREGATE: "#d9c7a3",
    Phase.VOID: "#ffffff",
    Phase.INTERFACE: ORANGE,
    Phase.TOUCHING: PURPLE,
}

# from hardly visible to nearly black through yellow and red: also monotonic in grey
DAMAGE: Colormap = LinearSegmentedColormap.from_list("damage", ["#f4e7c8", "#f0b84c", "#d9541e", "#8a1328", "#1f0516"])

STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.linewidth": 0.6,
    "axes.edgecolor": BLACK,
    "axes.labelcolor": BLACK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.color": BLACK,
    "ytick.color": BLACK,
    "text.color": BLACK,
    "lines.linewidth": 1.3,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "figure.facecolor": "white",
    "figure.constrained_layout.use": True,
    "image.cmap": "viridis",
    "mathtext.default": "it",
}

Draw = Callable[[Axes], Any]


def png(*draw: Draw, width: float = 96.0, height: float = 66.0, columns: int = 1) -> bytes:
    """Draw one or more axes and return them as a PNG; no global state of matplotlib is kept.

    Parameters
    ----------
    draw : functions of one Axes, each a panel, row by row
    width, height : float, mm of the whole figure, empty rims cut off
    columns : int; panels side by side
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width / MM_PER_INCH, height / MM_PER_INCH))
        FigureCanvasAgg(figure)
        rows = -(-len(draw) // columns)
        panels = np.ravel(figure.subplots(rows, columns, squeeze=False))
        for panel, one in zip(panels, draw, strict=False):
            one(panel)
        for empty in panels[len(draw) :]:
            empty.set_axis_off()
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=DPI, bbox_inches="tight", pad_inches=0.04)
    return stream.getvalue()


def disks(axes: Axes, position: np.ndarray, radius: float, **colour: Any) -> EllipseCollection:
    """Particles as disks to scale.

    Parameters
    ----------
    axes : Axes in mm
    position : (n, 2) array, m
    radius : float, m; drawn 2/√3 larger, so that no light shows between three neighbours
    colour : facecolors, or array with cmap and norm
    """
    size = np.full(len(position), 2 * 2 / np.sqrt(3) * radius / MM)
    found = EllipseCollection(
        size,
        size,
        0 * size,
        units="xy",
        offsets=position / MM,
        offset_transform=axes.transData,
        linewidths=0,
        antialiaseds=False,
        **colour,
    )
    axes.add_collection(found)
    return found


def specimen_axes(axes: Axes, bounds: tuple[float, float, float, float], margin: float = 0.0) -> None:
    """Equal scales in mm around a region, labelled.

    Parameters
    ----------
    axes : Axes
    bounds : x0, y0, x1, y1 in m
    margin : float, m
    """
    x0, y0, x1, y1 = (v / MM for v in bounds)
    axes.set(xlim=(x0 - margin / MM, x1 + margin / MM), ylim=(y0 - margin / MM, y1 + margin / MM))
    axes.set(xlabel="$x$ (mm)", ylabel="$y$ (mm)")
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)


def outline(axes: Axes, specimen: Specimen) -> None:
    """The boundary of a specimen and its notch, on a light rim that shows on dark ground."""
    for polygon in specimen.outline():
        axes.plot(*polygon.T / MM, color="white", linewidth=1.6)
        axes.plot(*polygon.T / MM, color=BLACK, linewidth=0.7)


def colour_bar(axes: Axes, mappable: ScalarMappable, label: str) -> Axes:
    """A colour bar exactly as high as the axes; its own axes are returned."""
    side = axes.inset_axes((1.03, 0.0, 0.03, 1.0))
    axes.get_figure(root=True).colorbar(mappable, cax=side, label=label)  # type: ignore[union-attr]
    return side
