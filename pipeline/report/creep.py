"""Creep compliance, relaxation modulus and master curve."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from pipeline.core.units import GPA
from pipeline.report.style import BLACK, BLUE, GREEN, LIGHT, MEASURED, ORANGE, SIMULATED, VERMILION

KELVIN = 273.15
COLD_TO_WARM = "plasma"  # without its palest end


def creep_compliance(
    axes: Axes,
    time: np.ndarray,
    compliance: np.ndarray,
    at: np.ndarray,
    fits: Mapping[str, np.ndarray],
    band: tuple[np.ndarray, np.ndarray] | None = None,
    window: tuple[float, float] | None = None,
) -> Axes:
    """Measured compliance with the fits and the 95 % band of the first of them.

    Parameters
    ----------
    axes : Axes
    time, compliance : (n,) arrays, s and 1/Pa; measured, perhaps shifted
    at : (k,) array, s; where the fits are drawn
    fits : label → (k,) array, 1/Pa
    band : two (k,) arrays, 1/Pa, or None
    window : s; the part that the first fit was made for, or None
    """
    if band is not None:
        axes.fill_between(at, band[0] * GPA, band[1] * GPA, color=LIGHT, linewidth=0, label="95 % of the fit")
    for (label, values), colour in zip(fits.items(), (SIMULATED, VERMILION), strict=False):
        axes.plot(at, values * GPA, color=colour, label=label)
    axes.plot(time, compliance * GPA, "o", markersize=3.2, markerfacecolor="white", color=MEASURED, label="measured")
    _edges(axes, window)
    axes.set(xscale="log", yscale="log", xlabel="time $t$ (s)", ylabel="creep compliance $D$ (1/GPa)")
    axes.legend(loc="upper left")
    return axes


def relaxation_modulus(
    axes: Axes,
    at: np.ndarray,
    moduli: Mapping[str, np.ndarray],
    band: tuple[np.ndarray, np.ndarray] | None = None,
    window: tuple[float, float] | None = None,
) -> Axes:
    """Relaxation moduli with the 95 % band of the first of them; arguments as of `creep_compliance`, moduli in Pa."""
    if band is not None:
        axes.fill_between(at, band[0] / GPA, band[1] / GPA, color=LIGHT, linewidth=0, label="95 % of the fit")
    for (label, values), colour in zip(moduli.items(), (SIMULATED, VERMILION), strict=False):
        axes.plot(at, values / GPA, color=colour, label=label)
    _edges(axes, window)
    axes.set(xscale="log", xlabel="time $t$ (s)", ylabel="relaxation modulus $E$ (GPa)")
    axes.set_ylim(bottom=0)
    axes.legend(loc="upper right")
    return axes


def master_curve(axes: Axes, reduced: np.ndarray, compliance: np.ndarray, temperature: np.ndarray) -> Axes:
    """Shifted readings, coloured by temperature.

    Parameters
    ----------
    axes : Axes
    reduced, compliance : (n,) arrays, s and 1/Pa
    temperature : (n,) array, K
    """
    levels = np.unique(temperature)
    colours = ScalarMappable(Normalize(levels[0], levels[-1] + 0.2 * np.ptp(levels)), COLD_TO_WARM)
    for level in levels:
        use = temperature == level
        axes.plot(
            reduced[use],
            compliance[use] * GPA,
            "o-",
            markersize=3.2,
            linewidth=0.8,
            color=colours.to_rgba(level),
            label=f"{level - KELVIN:.4g} °C",
        )
    axes.set(xscale="log", yscale="log", xlabel="reduced time $t/a_T$ (s)", ylabel="creep compliance $D$ (1/GPa)")
    axes.legend(loc="upper left")
    return axes


def shift_factors(
    axes: Axes,
    temperature: np.ndarray,
    log_shift: np.ndarray,
    interval: np.ndarray,
    at: np.ndarray,
    laws: Mapping[str, np.ndarray],
) -> Axes:
    """Free shifts with their intervals, and the laws through them.

    Parameters
    ----------
    axes : Axes
    temperature, log_shift : (m,) arrays, K and log₁₀ a_T
    interval : (m, 2) array
    at : (k,) array, K
    laws : label → (k,) array
    """
    for (label, values), colour in zip(laws.items(), (BLUE, ORANGE, GREEN), strict=False):
        axes.plot(at - KELVIN, values, color=colour, label=label)
    error = np.abs(interval.T - log_shift)
    axes.errorbar(
        temperature - KELVIN, log_shift, error, fmt="o", color=BLACK, markersize=3.2, linewidth=0.8, label="free, 95 %"
    )
    axes.set(xlabel="temperature (°C)", ylabel="shift log₁₀ $a_T$")
    axes.legend(loc="upper right")
    return axes


def _edges(axes: Axes, window: tuple[float, float] | None) -> None:
    for edge in window or ():
        axes.axvline(edge, color=LIGHT, linewidth=0.8, zorder=0)
