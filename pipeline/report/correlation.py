"""What image correlation saw: displacements over the photograph, the crack in it, how sure it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, CenteredNorm, ListedColormap, LogNorm, Normalize
from matplotlib.patches import Patch

from pipeline.core.curve import LoadCurve
from pipeline.core.field import rigid_motion
from pipeline.core.units import MM, UM
from pipeline.dic.correlation import Correlation
from pipeline.dic.crack import Crack
from pipeline.dic.status import Status
from pipeline.report.photograph import bare, draw_path, paint, photograph_axes, stretched
from pipeline.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    MEASURED,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    YELLOW,
    colour_bar,
)

STATUS_COLOURS = {
    Status.OK: "#e3ebf1",
    Status.SPLIT: BLUE,
    Status.ON_CRACK: VERMILION,
    Status.TWO_CRACKS: PURPLE,
    Status.POOR_MATCH: ORANGE,
    Status.OUTLIER: YELLOW,
    Status.NO_CONTRAST: GREY,
    Status.OUTSIDE: LIGHT,
    Status.NOT_CONVERGED: GREEN,
    Status.NOT_REACHED: BLACK,
}
BEYOND = 0.02  # share of the values that may lie beyond the ends of a colour scale: failed neighbours of a crack
OPENING = "plasma"


@dataclass(frozen=True, eq=False)
class Sight:
    """One frame to be drawn.

    Parameters
    ----------
    result : Correlation
    crack : Crack in px, or None
    metre_per_px : float, m
    title : str
    """

    result: Correlation
    crack: Crack | None
    metre_per_px: float
    title: str = ""


def component_map(axes: Axes, picture: np.ndarray, sight: Sight, values: np.ndarray, label: str) -> Axes:
    """One value a point over the photograph; points without a result leave it bare.

    Parameters
    ----------
    axes : Axes
    picture : (rows, columns) array, grey values
    sight : Sight
    values : (n,) array; NaN where there is none
    label : str; of the colour bar
    """
    photograph_axes(axes, picture, sight.metre_per_px, dim=0.35)
    painted = paint(axes, sight.result, values, *_scale(values))
    colour_bar(axes, painted, label)
    draw_path(axes, sight.crack)
    axes.set_title(sight.title)
    return axes


def _scale(values: np.ndarray) -> tuple[str, Normalize]:
    """Colours for values of both signs, or of one; a few strays do not stretch the scale."""
    known = values[np.isfinite(values)]
    low, high = np.quantile(known, [BEYOND / 2, 1 - BEYOND / 2]) if known.size else (-1.0, 1.0)
    if low < 0 < high and min(-low, high) > 0.2 * max(-low, high):
        return "RdBu_r", CenteredNorm(0.0, max(-low, high))
    return "cividis", Normalize(low, max(high, low + 1e-12))


def crack_overlay(axes: Axes, picture: np.ndarray, sight: Sight) -> Axes:
    """The cuts of all split subsets over the photograph in which the crack is open, and its smoothed path.

    Each cut is drawn at the line that parts its subset, where that lies now, and coloured by the opening there.

    Parameters
    ----------
    axes : Axes
    picture : (rows, columns) array; of this frame
    sight : Sight
    """
    photograph_axes(axes, picture, sight.metre_per_px)
    pieces, opening = cuts(sight.result)
    shown = opening * sight.metre_per_px / UM
    top = float(np.quantile(shown, 0.98)) if shown.size else 1.0
    axes.add_collection(LineCollection(list(pieces), colors="white", linewidths=2.4, alpha=0.35, capstyle="round"))
    norm = Normalize(0, max(top, 1e-12))
    line = LineCollection(list(pieces), array=shown, cmap=OPENING, norm=norm, linewidths=1.3, capstyle="round")
    axes.add_collection(line)
    colour_bar(axes, line, "opening (µm)")
    if sight.crack is not None and not sight.crack.through:
        tip = moved_tip(sight.result, sight.crack)
        axes.plot(*tip, "o", markersize=9, markerfacecolor="none", markeredgecolor=YELLOW, markeredgewidth=1.2)
        axes.annotate("tip", (tip[0], tip[1]), xytext=(7, 5), textcoords="offset points", color=YELLOW, fontsize=8)
    axes.set_title(sight.title)
    return axes


def cuts(result: Correlation) -> tuple[np.ndarray, np.ndarray]:
    """Pieces of the crack as split subsets saw it, where they lie in the deformed picture.

    Only cuts whose far side was matched too, and that open by more than three standard deviations, are among them.

    Returns
    -------
    pieces : (m, 2, 2) array, px; start and end of each, one grid step long
    opening : (m,) array, px
    """
    opening, spread = result.opening, result.jump_std[:, 0]
    use = result.split & np.isfinite(opening) & (opening > 3 * np.nan_to_num(spread, nan=np.inf))
    normal, foot = result.normal[use], result.foot[use]
    arm = foot - result.points[use]
    warp = result.warp[use]
    basis = np.column_stack([np.ones(len(arm)), arm])
    near = np.column_stack([np.sum(basis * warp[:, [0, 2, 3]], 1), np.sum(basis * warp[:, [1, 4, 5]], 1)])
    middle = foot + near + 0.5 * result.jump[use]
    along = np.column_stack([-normal[:, 1], normal[:, 0]]) * 0.5 * float(np.diff(result.grid.columns[:2]).sum())
    return np.stack([middle - along, middle + along], axis=1), opening[use]


def moved_tip(result: Correlation, crack: Crack) -> np.ndarray:
    """Where the tip (2,) of a crack lies in the deformed picture, px: it goes with the sound point nearest to it."""
    known = np.flatnonzero(result.valid)
    nearest = known[np.argmin(np.linalg.norm(result.points[known] - crack.tip, axis=1))]
    return crack.tip + result.warp[nearest, :2]


def quality_map(axes: Axes, picture: np.ndarray, sight: Sight) -> Axes:
    """What became of each point, with the counts."""
    photograph_axes(axes, picture, sight.metre_per_px, dim=0.5)
    status, fates = sight.result.status, list(Status)
    colours = [STATUS_COLOURS.get(fate, SKY) for fate in fates]
    norm = BoundaryNorm(np.arange(len(fates) + 1) - 0.5, len(fates))
    paint(axes, sight.result, np.searchsorted(fates, status).astype(float), ListedColormap(colours), norm)
    counts = [int(np.count_nonzero(status == fate)) for fate in fates]
    patches = [
        Patch(facecolor=colour, edgecolor=GREY, linewidth=0.3, label=f"{_fate(fate)}: {count}")
        for fate, colour, count in zip(fates, colours, counts, strict=True)
        if count
    ]
    axes.legend(handles=patches, loc="upper left", bbox_to_anchor=(1.01, 1.0), handlelength=1.0, borderaxespad=0)
    axes.set_title(sight.title)
    return axes


def _fate(code: Status) -> str:
    return code.name.lower().replace("_", " ")


def misfit_map(axes: Axes, picture: np.ndarray, sight: Sight) -> Axes:
    """ZNSSD of every sound point, on a logarithmic scale."""
    photograph_axes(axes, picture, sight.metre_per_px, dim=0.5)
    values = np.where(sight.result.valid, np.maximum(sight.result.znssd, 1e-9), np.nan)
    known = values[np.isfinite(values)]
    low, high = np.quantile(known, [0.01, 0.999]) if known.size else (1e-3, 1.0)
    painted = paint(axes, sight.result, values, "viridis", LogNorm(low, max(high, 1.01 * low)))
    colour_bar(axes, painted, "ZNSSD (0: perfect match)")
    axes.set_title(sight.title)
    return axes


def opening_profile(axes: Axes, sights: Sequence[Sight], band: float = 2.0) -> Axes:
    """Opening along the path from the mouth to the tip, frame by frame, with its uncertainty.

    Parameters
    ----------
    axes : Axes
    sights : those with a crack are drawn
    band : float; half width of the band in standard deviations
    """
    shown = [s for s in sights if s.crack is not None]
    shades = _shades(len(shown))
    for sight, colour in zip(shown, shades, strict=True):
        crack, scale = sight.crack, sight.metre_per_px
        assert crack is not None
        arc, opening, std = crack.arc * scale / MM, crack.opening * scale / UM, crack.std * scale / UM
        size = min(len(arc), len(opening))
        arc, opening, std = arc[:size], opening[:size], std[:size]
        axes.fill_between(arc, opening - band * std, opening + band * std, color=colour, alpha=0.3, linewidth=0)
        axes.plot(arc, opening, color=colour, label=sight.title)
        if not crack.through:
            axes.plot(
                crack.arc[-1] * scale / MM, 0, "|", color=colour, markersize=7, markeredgewidth=1.4, clip_on=False
            )
    axes.set(xlabel="along the crack, from the mouth (mm)", ylabel="opening (µm)")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    if shown:
        axes.legend(loc="upper right")
    return axes


def _shades(count: int) -> list[tuple[float, float, float, float]]:
    from matplotlib import colormaps

    return [colormaps["viridis"](v) for v in np.linspace(0.05, 0.85, max(count, 1))][:count]


def contact_panel(axes: Axes, sight: Sight, norm: Normalize, picture: np.ndarray) -> Axes:
    """One frame of a contact sheet: motion across the crack without the rigid part, and the crack.

    Parameters
    ----------
    axes : Axes
    sight : Sight
    norm : Normalize in µm, the same for all
    picture : (rows, columns) array; of the frame
    """
    axes.imshow(0.35 + 0.65 * stretched(picture), cmap="gray", vmin=0, vmax=1)
    axes.set(xlim=(-0.5, picture.shape[1] - 0.5), ylim=(picture.shape[0] - 0.5, -0.5))
    bare(axes)
    paint(axes, sight.result, without_rigid(sight.result)[:, 0] * sight.metre_per_px / UM, "RdBu_r", norm)
    draw_path(axes, sight.crack)
    axes.set_title(sight.title, fontsize=7, fontweight="normal")
    return axes


def without_rigid(result: Correlation) -> np.ndarray:
    """Displacements (n, 2), px, without translation and rotation; NaN where a point failed."""
    moved = np.nan_to_num(result.displacement)
    left = moved - rigid_motion(result.points, moved, result.valid)
    return np.where(result.valid[:, None], left, np.nan)


def clocks(
    axes: Axes, record: LoadCurve | None, stamp: np.ndarray, offset: float, seen: np.ndarray, gain: float, zero: float
) -> Axes:
    """The opening that the camera saw, at the times of its own clock and of the record's, on the record's CMOD.

    Parameters
    ----------
    axes : Axes
    record : LoadCurve or None
    stamp : (frames,) array, s; of the camera
    offset : float, s
    seen : (frames,) array, m
    gain, zero : opening seen = gain × CMOD + zero
    """
    shown = (seen - zero) / gain / MM
    if record is not None:
        axes.plot(record.time, record.cmod / MM, color=MEASURED, linewidth=1.0, label="record")
    if offset:
        axes.plot(stamp, shown, ".", color=LIGHT, markersize=4, label="camera, its own clock")
    axes.plot(stamp - offset, shown, "o", color=SKY, markersize=3.2, markeredgecolor=BLUE, markeredgewidth=0.5,
              label="camera" + (", on the record's clock" if offset else ""))  # fmt: skip
    axes.set(xlabel="time (s)", ylabel="CMOD (mm)")
    axes.legend(loc="upper left")
    return axes
