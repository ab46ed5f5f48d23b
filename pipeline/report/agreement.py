"""How far engines lie apart: convergence, checks, differences of curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from pipeline.core.units import MM
from pipeline.report.style import BLUE, GREEN, GREY, LIGHT, ORANGE, SKY, VERMILION

SERIES = (BLUE, VERMILION, GREEN, ORANGE, SKY)


def convergence(axes: Axes, steps: np.ndarray, error: Mapping[str, np.ndarray], order: float) -> Axes:
    """Errors against the number of steps, with a line of the order that was measured.

    Parameters
    ----------
    axes : Axes
    steps : (k,) array
    error : (k,) arrays by name
    order : float
    """
    for (name, values), colour in zip(error.items(), SERIES, strict=False):
        axes.loglog(steps, values, "o-", color=colour, markersize=4, label=name)
    first = next(iter(error.values()))
    middle = np.exp(np.mean(np.log(first))) * (steps / np.exp(np.mean(np.log(steps)))) ** -order
    axes.loglog(steps, middle, "--", color=GREY, linewidth=0.9, label=f"order {order:.2g}")
    axes.set(xlabel="steps", ylabel="difference from equilibrium")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.legend(loc="lower left")
    return axes


def checks(axes: Axes, names: Sequence[str], share: Sequence[float]) -> Axes:
    """Every check's difference as a share of its tolerance; beyond 1 it failed.

    Parameters
    ----------
    axes : Axes
    names : sequence of str
    share : sequence of float; difference over tolerance
    """
    shown = np.clip(np.nan_to_num(np.asarray(share, float), nan=np.inf), 1e-4, 1e2)
    rows = np.arange(len(names))
    axes.barh(rows, shown, color=[BLUE if s <= 1 else VERMILION for s in shown], height=0.7, left=0)
    axes.axvline(1, color=VERMILION, linewidth=0.9)
    axes.set_xscale("log")
    axes.set(xlim=(1e-4, max(3.0, 1.5 * shown.max())), xlabel="difference / tolerance", yticks=rows)
    axes.set_yticklabels(names, fontsize=6)
    axes.invert_yaxis()
    return axes


def load_differences(axes: Axes, cmod: np.ndarray, differences: Mapping[str, np.ndarray]) -> Axes:
    """Differences of the load from a limit over CMOD, relative to the largest load.

    Parameters
    ----------
    axes : Axes
    cmod : (k,) array, m
    differences : (k,) arrays by name, relative
    """
    axes.axhline(0, color=LIGHT, linewidth=0.9)
    for (name, values), colour in zip(differences.items(), SERIES, strict=False):
        axes.plot(cmod / MM, 100 * values, color=colour, label=name)
    axes.set(xlabel="CMOD (mm)", ylabel="load difference (% of the peak)")
    axes.legend(loc="best")
    return axes
