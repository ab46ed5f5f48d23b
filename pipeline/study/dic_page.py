"""What the command `dic` shows: figures as PNG beside the results, and one self-contained page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import CenteredNorm

from pipeline.core.units import UM
from pipeline.report.correlation import (
    Sight,
    clocks,
    component_map,
    contact_panel,
    crack_overlay,
    misfit_map,
    opening_profile,
    quality_map,
    without_rigid,
)
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.style import Draw, png
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import Bundle
from pipeline.store.images import read_grey
from pipeline.study.measurement import Measurement, frame_field

SHEET, PROFILES = 12, 6  # frames on the contact sheet and among the profiles
WIDTH = 190.0  # mm


def dic_page(folder: Path, bundle: Bundle, found: Measurement, result: Mapping[str, Any]) -> None:
    """Crack, displacements, opening, quality and clock of a measurement."""
    last = len(found.series) - 1
    cracked = np.flatnonzero(np.isfinite(found.tip_px[:, 0]))
    at = int(cracked[-1]) if cracked.size else last
    sections = [
        Section("What was measured", numbers=_numbers(result), figures=_crack(folder, bundle, found, at)),
        Section("Displacements", figures=[_maps(folder, bundle, found, last), _sheet(folder, bundle, found)]),
        Section("How sure it is", figures=_quality(folder, bundle, found, last), notes=_notes()),
    ]
    title = f"{result['frames']} images correlated, subsets of {result['subset_size_px']} px"
    footer = [f"cohesive-bpm {result['version']}, command {result['command']}"]
    html = page(bundle.name, sections, subtitle=title, warnings=result["warnings"], footer=footer)
    write_atomically(folder / "report.html", html.encode())


def sight(bundle: Bundle, found: Measurement, number: int) -> Sight:
    """A frame to be drawn, called by its CMOD, or by its time."""
    frame = found.series.frame(number)
    return Sight(frame.result, frame.crack, found.series.view.metre_per_px, name_of(bundle, found, number))


def name_of(bundle: Bundle, found: Measurement, number: int) -> str:
    """The CMOD of a frame where there is a record, else its time."""
    moment = float(found.record_time[number])
    cmod = float("nan") if bundle.curve is None else float(bundle.curve.cmod_at(np.array([moment]))[0])
    return f"CMOD {cmod * 1e3:.3f} mm" if np.isfinite(cmod) else f"{found.series.stamp[number]:.1f} s"


def _crack(folder: Path, bundle: Bundle, found: Measurement, at: int) -> list[Figure]:
    picture, seen = read_grey(found.series.images[at]), sight(bundle, found, at)
    chosen = _spread(np.flatnonzero(np.isfinite(found.tip_px[:, 0])), PROFILES)
    profiles = [sight(bundle, found, int(k)) for k in chosen]
    overlay = _figure(
        folder,
        "crack",
        [partial(crack_overlay, picture=picture, sight=seen)],
        "The photograph with the cuts of all split subsets, coloured by their opening. No path was given.",
        picture.shape,
    )
    opening = _figure(
        folder,
        "opening",
        [partial(opening_profile, sights=profiles)],
        "Opening along the crack with two standard deviations on either side; a tick marks the tip.",
        (66, 100),
        width=100.0,
    )
    return [overlay, opening, *_clock(folder, bundle, found)]


def _clock(folder: Path, bundle: Bundle, found: Measurement) -> list[Figure]:
    timing = found.timing
    if timing.opening is None:
        return []
    draw = partial(
        clocks,
        record=bundle.curve,
        stamp=found.series.stamp,
        offset=timing.offset,
        seen=timing.opening.value,
        gain=timing.gain,
        zero=timing.zero,
    )
    caption = "The opening that the camera saw, and the clip gauge's: by their shift the clocks are brought together."
    return [_figure(folder, "clock", [draw], caption, (66, 100), width=100.0)]


def _maps(folder: Path, bundle: Bundle, found: Measurement, number: int) -> Figure:
    picture, seen = read_grey(found.series.images[0]), sight(bundle, found, number)
    moved = frame_field(found.series, seen.result, 1.0).displacement[0] / UM
    draw = [
        partial(component_map, picture=picture, sight=seen, values=moved[:, k], label=f"$u_{name}$ (µm)")
        for k, name in enumerate("xy")
    ]
    caption = "Displacement over the unloaded photograph, x across and y along the notch; the line is the crack."
    return _figure(folder, "displacement", draw, caption, picture.shape, columns=2)


def _sheet(folder: Path, bundle: Bundle, found: Measurement) -> Figure:
    chosen = _spread(np.arange(1, len(found.series)), SHEET)
    last = without_rigid(found.series.frame(len(found.series) - 1).result)[:, 0] * found.series.view.metre_per_px / UM
    norm = CenteredNorm(0.0, float(np.nanquantile(np.abs(last), 0.98)))
    picture = read_grey(found.series.images[0])
    draw: list[Draw] = [partial(_panel, bundle=bundle, found=found, number=int(k), norm=norm, picture=picture)
                        for k in chosen]  # fmt: skip
    caption = (
        "The test from the first to the last image: motion across the picture without its rigid part, and the crack."
    )
    return _figure(folder, "contact_sheet", draw, caption, picture.shape, columns=4)


def _panel(
    axes: Axes, bundle: Bundle, found: Measurement, number: int, norm: CenteredNorm, picture: np.ndarray
) -> Axes:
    return contact_panel(axes, sight(bundle, found, number), norm, picture)


def _quality(folder: Path, bundle: Bundle, found: Measurement, number: int) -> list[Figure]:
    picture, seen = read_grey(found.series.images[0]), sight(bundle, found, number)
    draw = [partial(quality_map, picture=picture, sight=seen), partial(misfit_map, picture=picture, sight=seen)]
    caption = "What became of each point in the last image, and how well it matches."
    return [_figure(folder, "quality", draw, caption, picture.shape, columns=2)]


def _figure(
    folder: Path,
    name: str,
    draw: Sequence[Draw],
    caption: str,
    shape: tuple[int, ...],
    columns: int = 1,
    width: float = WIDTH,
) -> Figure:
    """One or more panels of the shape of a picture (rows, columns), as PNG and for the page."""
    rows = -(-len(draw) // columns)
    height = width / columns * shape[0] / shape[1] * rows
    image = png(*draw, width=width, height=min(height + 6 * rows, 260.0), columns=columns)
    write_atomically(folder / f"{name}.png", image)
    return Figure(image, caption, wide=width == WIDTH)


def _spread(numbers: np.ndarray, count: int) -> np.ndarray:
    """At most `count` of the numbers, evenly from the first to the last."""
    return numbers[np.unique(np.linspace(0, numbers.size - 1, count).round().astype(int))] if numbers.size else numbers


def _numbers(result: Mapping[str, Any]) -> list[Number]:
    tip = next((t for t in reversed(result["crack_tip_px"]) if t is not None), None)
    rest = result["frames_at_rest"]
    checked = (
        f"{result['noise_factor']:.2f} times the camera's, from {rest} images at rest" if rest > 1 else "not checked"
    )
    clock = result["sync_offset_s"]
    return [
        Number("points", f"{result['points']}", f"{result['valid_fraction']:.1%} with a result, mean over the images"),
        Number("cut by the crack", f"{result['split_fraction']:.1%}", "of the points, in the last image"),
        Number("noise", f"{result['noise_px']:.4f} px", f"one displacement component; {checked}"),
        Number(
            "crack tip", "none" if tip is None else f"({tip[0]:.0f}, {tip[1]:.0f}) px", "in the last image that has one"
        ),
        Number("camera's clock", "–" if clock is None else f"{clock:+.3f} s", result["sync"]),
        Number("speed", f"{result['subsets_per_second']:.0f}/s", "subsets correlated a second"),
    ]


def _notes() -> list[str]:
    return [
        "ok: one affine motion explains the subset; split: a straight cut parts it, and the part that holds the "
        "centre was matched.",
        "on crack, two cracks, poor match, outlier, no contrast: no result, and why. These points are left out, not "
        "filled in.",
    ]
