"""Figures: real PNGs, no global state, colours that survive grey and colour-blindness."""

from __future__ import annotations

import subprocess
import sys

import cv2
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from pipeline.report.style import DAMAGE, DPI, MM_PER_INCH, PHASE_COLOURS, colour_bar, disks, png, specimen_axes

LINEAR = np.array([0.2126, 0.7152, 0.0722])  # share of each primary in luminance, Rec. 709


def luminance(colour) -> float:
    c = np.array(to_rgb(colour))
    return float(LINEAR @ np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4))


def pixels(image: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)


def test_a_png_has_the_asked_size_at_most():
    image = pixels(png(lambda axes: axes.plot([0, 1], [0, 1]), width=100, height=60))
    assert image.shape[1] <= 102 / MM_PER_INCH * DPI  # rims are cut, 1 mm is added on either side
    assert image.shape[1] > 85 / MM_PER_INCH * DPI


def test_global_settings_stay_as_they_were():
    before = dict(matplotlib.rcParams)
    png(lambda axes: axes.set_title("x"))
    assert dict(matplotlib.rcParams) == before


def test_pyplot_is_never_loaded():
    """pyplot keeps figures alive and picks a screen; importing the room must not load it."""
    code = (
        "import sys, pipeline.report.fields, pipeline.report.objective, pipeline.report.curves, pipeline.report.page\n"
    )
    code += "sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_panels_are_laid_out_and_the_rest_left_empty():
    seen: list[Axes] = []
    png(*[seen.append] * 3, columns=2)
    assert len(seen) == 3
    assert len(seen[0].get_figure().axes) == 4
    assert not seen[0].get_figure().axes[3].axison


def test_disks_touch_to_scale():
    """A red disk of 10 mm radius in a window of 40 mm covers π/16 · 4/3 of it (drawn 2/√3 larger)."""

    def draw(axes: Axes) -> None:
        disks(axes, np.array([[0.0, 0.0]]), 10e-3, facecolors=["red"])
        specimen_axes(axes, (-20e-3, -20e-3, 20e-3, 20e-3))
        axes.set_axis_off()

    image = pixels(png(draw, width=60, height=60)).astype(int)
    red = (image[..., 2] > 200) & (image[..., 1] < 80)
    height, width = np.ptp(np.argwhere(red), axis=0) + 1
    assert abs(height - width) <= 2  # pixels; a disk stays round
    assert np.sum(red) / (height * width) == np.clip(np.sum(red) / (height * width), 0.77, 0.80)  # π/4


def test_damage_gets_darker_and_never_lighter():
    steps = [luminance(DAMAGE(x)) for x in np.linspace(0, 1, 101)]
    assert np.all(np.diff(steps) < 1e-3)
    assert steps[0] - steps[-1] > 0.6


def test_phases_differ_in_grey():
    grey = sorted(luminance(c) for c in PHASE_COLOURS.values())
    assert luminance(PHASE_COLOURS[2]) - luminance(PHASE_COLOURS[1]) > 0.3
    assert grey[0] < 0.1


def test_a_colour_bar_is_as_high_as_its_axes():
    def draw(axes: Axes) -> None:
        painted = disks(axes, np.zeros((2, 2)), 1e-3, array=np.array([0.0, 1.0]))
        specimen_axes(axes, (-0.1, -0.02, 0.1, 0.02))
        side = colour_bar(axes, painted, "µm")
        axes.get_figure().canvas.draw()
        assert side.get_window_extent().height == np.float64(axes.get_window_extent().height)

    png(draw)
