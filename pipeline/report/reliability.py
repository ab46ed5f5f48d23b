"""How often a stated probability was right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pipeline.report.style import BLUE, GREY


def reliability(axes: Axes, bins: Sequence[Mapping[str, Any]]) -> Axes:
    """Achieved against stated probability.

    Parameters
    ----------
    axes : matplotlib Axes
    bins : rows with "stated", "achieved", "cases" and "interval_95"

    Returns
    -------
    the axes: on the line, what was stated was achieved; below it, too much was promised
    """
    stated, achieved = (np.array([b[key] for b in bins]) for key in ("stated", "achieved"))
    ends = np.array([b["interval_95"] for b in bins])
    bars = np.maximum(np.stack([achieved - ends[:, 0], ends[:, 1] - achieved]), 0.0)
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.8, linestyle="--")
    axes.errorbar(stated, achieved, yerr=bars, color=BLUE, marker="o", markersize=3, linewidth=1, capsize=2)
    for b in bins:
        axes.annotate(f"{b['cases']:.0f}", (b["stated"], b["achieved"]), (3, 3), textcoords="offset points", fontsize=6)
    axes.set(xlabel="stated probability", ylabel="share that was right", xlim=(0, 1), ylim=(0, 1), aspect="equal")
    return axes
