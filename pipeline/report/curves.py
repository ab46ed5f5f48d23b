"""Load–CMOD curves and energies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import offset_copy

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import EnergyBalance
from pipeline.core.units import KN, MM
from pipeline.report.style import GREEN, GREY, LIGHT, MEASURED, ORANGE, SIMULATED, SKY, VERMILION

SERIES = (SIMULATED, VERMILION, GREEN, ORANGE, SKY)


def load_cmod(
    axes: Axes,
    measured: LoadCurve | None,
    simulated: Mapping[str, LoadCurve],
    stations: np.ndarray | None = None,
    band: float = 2.0,
) -> Axes:
    """Measured and simulated load over CMOD, with the peaks and the stations at which fields are compared.

    Parameters
    ----------
    axes : Axes
    measured : LoadCurve or None; its `load_std` becomes a band
    simulated : LoadCurve by label
    stations : (s,) array, m, or None
    band : float; half width of the band in standard deviations
    """
    if measured is not None:
        _measured(axes, measured, stations, band)
    for (label, curve), colour in zip(simulated.items(), SERIES, strict=False):
        axes.plot(curve.cmod / MM, curve.load / KN, color=colour, label=label)
        _peak(axes, curve, colour)
    end = max(float(c.cmod.max()) for c in (measured, *simulated.values()) if c is not None)
    axes.set(xlabel="CMOD (mm)", ylabel="load $P$ (kN)", xlim=(0, end / MM * 1.02))
    lowest = min(float(c.load.min()) for c in (measured, *simulated.values()) if c is not None)
    axes.set_ylim(bottom=1.05 * min(lowest, 0.0) / KN)
    axes.legend(loc="upper right")
    return axes


def energy_balance(axes: Axes, balance: EnergyBalance) -> Axes:
    """Where the machine's work went, as two stacked bars.

    Parameters
    ----------
    axes : Axes
    balance : EnergyBalance
    """
    parts = {
        "dissipated by bonds": (balance.dissipated, VERMILION),
        "stored": (balance.stored, SKY),
        "damped": (balance.damping, ORANGE),
        "kinetic": (balance.kinetic, GREEN),
    }
    axes.barh("machine work", balance.external, color=GREY, height=0.55)
    _annotate(axes, balance.external, "machine work", balance.external, balance.external)
    left = 0.0
    for name, (energy, colour) in parts.items():
        if abs(energy) > 5e-4 * abs(balance.external):
            axes.barh("accounted for", energy, left=left, color=colour, height=0.55, label=name)
            left += energy
    _annotate(axes, left, "accounted for", left, balance.external)
    axes.set(xlabel="energy (J)", xlim=(0, 1.3 * max(balance.external, left)))
    axes.invert_yaxis()
    axes.tick_params(axis="y", length=0)
    axes.legend(loc="upper center", bbox_to_anchor=(0.45, -0.32), ncols=4, columnspacing=1.2, handlelength=1.0)
    return axes


def _measured(axes: Axes, curve: LoadCurve, stations: np.ndarray | None, band: float) -> None:
    if curve.load_std is not None:
        low, high = (curve.load + sign * band * curve.load_std for sign in (-1, 1))
        label = f"± {band:g} standard deviations"
        axes.fill_between(curve.cmod / MM, low / KN, high / KN, color=LIGHT, linewidth=0, label=label)
    axes.plot(curve.cmod / MM, curve.load / KN, color=MEASURED, linewidth=0.9, label="measured")
    _peak(axes, curve, MEASURED)
    if stations is not None and stations.size:
        at = curve.load_at(stations)
        axes.plot(
            stations / MM, at / KN, "o", markersize=3.6, markerfacecolor="white", color=MEASURED, label="stations"
        )


def _peak(axes: Axes, curve: LoadCurve, colour: str) -> None:
    cmod, load = curve.peak()
    figure = axes.get_figure(root=True)
    above = offset_copy(axes.transData, figure, y=5, units="points")
    axes.plot(cmod / MM, load / KN, marker="v", markersize=4.5, color=colour, transform=above, zorder=5)


def _annotate(axes: Axes, x: float, y: str, energy: float, whole: float) -> None:
    share = f" ({energy / whole:.1%})" if energy != whole and whole else ""
    axes.annotate(
        f"{energy:.3g} J{share}", (x, y), xytext=(4, 0), textcoords="offset points", va="center", fontsize=7.5
    )
