"""Identified mixtures side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from pipeline.core.units import MM
from pipeline.report.style import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION

COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY)
CHI2_95 = 5.991  # of two degrees of freedom
TURN = np.linspace(0, 2 * np.pi, 73)


def parameter_plane(
    axes: Axes, traction: np.ndarray, opening: np.ndarray, log_covariance: np.ndarray, mixture: Sequence[str]
) -> Axes:
    """Each test as a point with the ellipse that holds it with 95 %, coloured by mixture.

    Parameters
    ----------
    axes : Axes
    traction : (n,) array, MPa; f_max/(2 r t)
    opening : (n,) array, m; delta_max
    log_covariance : (n, 2, 2) array; of the logarithms of the two, NaN where unknown: no ellipse
    mixture : n names
    """
    for name, colour in _colours(mixture):
        use = np.array([m == name for m in mixture])
        axes.plot(traction[use], opening[use] / MM, "o", markersize=3.6, color=colour, label=name)
        for t, d, c in zip(traction[use], opening[use], log_covariance[use], strict=True):
            if np.isfinite(c).all():
                axes.plot(*ellipse(t, d / MM, c), color=colour, linewidth=0.8)
    axes.set(xlabel="$f_{max}/(2rt)$ (MPa)", ylabel="$\\delta_{max}$ (mm)")
    axes.legend(loc="best")
    return axes


def against_temperature(
    axes: Axes,
    temperature: np.ndarray,
    value: np.ndarray,
    interval: np.ndarray,
    mixture: Sequence[str],
    label: str,
) -> Axes:
    """A property with its 95 % intervals over the temperature of the test.

    Parameters
    ----------
    axes : Axes
    temperature : (n,) array, °C; NaN: the test is not drawn
    value : (n,) array
    interval : (n, 2) array, NaN where there is none
    mixture : n names
    label : str; of the property, with its unit
    """
    for name, colour in _colours(mixture):
        use = np.array([m == name for m in mixture]) & np.isfinite(temperature)
        error = np.nan_to_num(np.abs(interval[use].T - value[use]))
        axes.errorbar(
            temperature[use], value[use], error, fmt="o", markersize=3.6, linewidth=0.8, color=colour, label=name
        )
    axes.set(xlabel="temperature (°C)", ylabel=label)
    axes.set_ylim(bottom=0)
    axes.legend(loc="best")
    return axes


def ellipse(x: float, y: float, log_covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The 95 % region of two positive numbers whose logarithms scatter normally; two (73,) arrays."""
    values, vectors = np.linalg.eigh(log_covariance)
    arms = vectors * np.sqrt(CHI2_95 * np.maximum(values, 0))
    off = arms @ np.array([np.cos(TURN), np.sin(TURN)])
    return x * np.exp(off[0]), y * np.exp(off[1])


def _colours(mixture: Sequence[str]) -> list[tuple[str, str]]:
    """Names in the order in which they come, each with its colour."""
    return [(name, COLOURS[k % len(COLOURS)]) for k, name in enumerate(dict.fromkeys(mixture))]
