"""Figures of a diagnosis: where, which, how far, and what could not have been seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from pipeline.core.units import KN, MM, UM
from pipeline.gap.observation import STAGES, Observation, Reading
from pipeline.report.style import BLACK, BLUE, GREY, LIGHT, MEASURED, ORANGE, VERMILION, colour_bar


def where_map(axes: Axes, cells: Sequence[Mapping[str, Any]], stage: str, against: str = "z_gap") -> Axes:
    """Region × mode of one stage: how many times what honest engines (or noise alone) would give.

    Parameters
    ----------
    cells : rows of `where` in result.json
    stage : str
    against : "z_gap" or "z_noise"
    """
    mine = [c for c in cells if c["stage"] == stage and c["channel"] == "field"]
    regions, modes = (list(dict.fromkeys(c[k] for c in cells if c["channel"] == "field")) for k in ("region", "mode"))
    regions, modes = sorted(regions), sorted(modes)
    table = np.full((len(regions), len(modes)), np.nan)
    for cell in mine:
        table[regions.index(cell["region"]), modes.index(cell["mode"])] = cell[against]
    loads = [c[against] for c in cells if c["stage"] == stage and c["channel"] == "load"]
    worst = max([4.0, *(c[against] for c in cells if c["channel"] == "field")])
    image = axes.imshow(table, cmap="YlOrRd", norm=LogNorm(1.0, worst), aspect="auto")
    for (row, column), value in np.ndenumerate(table):
        if np.isfinite(value):
            dark = value > np.sqrt(worst) * 1.5
            axes.text(column, row, f"{value:.2g}", ha="center", va="center", fontsize=6, color="w" if dark else BLACK)
    axes.set_xticks(range(len(modes)), modes, rotation=35, ha="right")
    axes.set_yticks(range(len(regions)), regions)
    load = f"; load {loads[0]:.1f}" if loads else ""
    axes.set_title(f"{stage}{load}")
    if stage == STAGES[-1]:
        colour_bar(axes, image, "× expected")
    return axes


def ranking(axes: Axes, probability: Mapping[str, float], most: int = 8) -> Axes:
    """Probabilities of the best explanations."""
    rows = sorted(probability.items(), key=lambda item: -item[1])[:most][::-1]
    axes.barh([n for n, _ in rows], [p for _, p in rows], color=[GREY if n == "none" else BLUE for n, _ in rows])
    axes.axvline(0.8, color=VERMILION, linewidth=0.8, linestyle="--")
    axes.set(xlabel="probability", xlim=(0, 1))
    return axes


def detectability(axes: Axes, limits: Mapping[str, Mapping[str, Any]], threshold: float) -> Axes:
    """d′ of every effect at its plausible maximum; below the line it would never be seen."""
    rows = sorted(limits.items(), key=lambda item: item[1]["d_prime_at_most"])
    values = np.maximum([row["d_prime_at_most"] for _, row in rows], 0.1)
    axes.barh([n for n, _ in rows], values, color=[BLUE if v >= threshold else LIGHT for v in values])
    axes.axvline(threshold, color=VERMILION, linewidth=0.8, linestyle="--")
    axes.set(xscale="log", xlabel="d′ at the plausible maximum")
    axes.tick_params(axis="y", labelsize=6)
    return axes


def closures(axes: Axes, found: Mapping[str, Mapping[str, Any]]) -> Axes:
    """How far explanations close the gap on held-out data, with 95 % intervals."""
    rows = [(n, c) for n, c in found.items() if c["fraction"] is not None][::-1]
    for place, (_, row) in enumerate(rows):
        low, high = row["interval_95"]
        axes.plot([low, high], [place, place], color=GREY)
        axes.plot(row["fraction"], place, "o", color=BLUE)
    axes.set_yticks(range(len(rows)), [n for n, _ in rows])
    axes.axvline(0, color=GREY, linewidth=0.6)
    axes.axvline(1, color=GREY, linewidth=0.6, linestyle="--")
    axes.set(xlabel="share of the gap closed on held-out data", xlim=(-0.6, 1.4))
    return axes


def loads(axes: Axes, observation: Observation, before: Reading, after: Reading, label: str) -> Axes:
    """Load at the stations: measured, the model as it is, and with the best explanation."""
    at = observation.sight.cmod / MM
    axes.errorbar(
        at, observation.reading.load / KN, 2 * observation.load_std / KN, fmt="o", color=MEASURED, label="measured"
    )
    axes.plot(at, before.load / KN, color=ORANGE, label="model as it is")
    axes.plot(at, after.load / KN, color=BLUE, label=f"with {label}" if label != "none" else "refitted")
    axes.set(xlabel="CMOD (mm)", ylabel="load (kN)")
    axes.legend()
    return axes


def differences(axes: Axes, observation: Observation, before: Reading, after: Reading) -> Axes:
    """Root mean square difference of displacements at every station, before and after, and the noise."""
    at = observation.sight.cmod / MM
    for reading, colour, label in ((before, ORANGE, "before"), (after, BLUE, "after")):
        square = np.sum((observation.reading.field - reading.field) ** 2, axis=2)
        axes.plot(at, np.sqrt(np.nanmean(square, axis=1)) / UM, color=colour, label=label)
    noise = np.sqrt(2 * np.nanmean(observation.field_std**2, axis=1)) / UM
    axes.plot(at, noise, color=GREY, linestyle=":", label="noise")
    axes.set(xlabel="CMOD (mm)", ylabel="difference (µm)", ylim=(0, None))
    axes.legend()
    return axes
