"""How far two results lie apart, and whether that is little enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import Solution


@dataclass(frozen=True)
class Check:
    """One line of a cross-check.

    Parameters
    ----------
    name : str; which specimen or formula
    compared : str; what with what, in which measure
    difference, tolerance : float, relative; NaN fails
    reason : str; where the tolerance comes from
    """

    name: str
    compared: str
    difference: float
    tolerance: float
    reason: str

    @property
    def passed(self) -> bool:
        return bool(self.difference <= self.tolerance)


def curve_difference(curve: LoadCurve, limit: LoadCurve, at: np.ndarray) -> float:
    """L2 norm of the difference of the loads at CMOD values `at` (k,), m, over that of `limit`."""
    wanted = limit.load_at(at)
    return float(np.linalg.norm(curve.load_at(at) - wanted) / np.linalg.norm(wanted))


def field_difference(seen: np.ndarray, limit: np.ndarray) -> float:
    """Largest over the stations of the L2 norm of the difference of displacements (s, p, 2) over that of `limit`."""
    stations = min(len(seen), len(limit))
    off, size = seen[:stations] - limit[:stations], limit[:stations]
    use = np.isfinite(off)
    norms = [np.linalg.norm(o[u]) / np.linalg.norm(s[u]) for o, s, u in zip(off, size, use, strict=True)]
    return float(max(norms)) if len(seen) == len(limit) and norms else float("nan")


def order_of_convergence(steps: np.ndarray, error: np.ndarray) -> float:
    """p of error ∝ steps⁻ᵖ, by least squares in the logarithms."""
    return float(-np.polyfit(np.log(steps), np.log(error), 1)[0])


def peak_difference(solution: Solution, limit: Solution) -> float:
    """Relative difference of the peak loads, with its sign."""
    return solution.curve.peak()[1] / limit.curve.peak()[1] - 1
