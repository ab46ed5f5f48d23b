"""Laws of time–temperature shift: Williams–Landel–Ferry and Arrhenius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from pipeline.core.errors import InputError
from pipeline.materials.master_curve import MasterCurve

GAS_CONSTANT = 8.314462618  # J/(mol K)
LN10 = float(np.log(10))
CONFIDENCE = 0.95
FLATTEST = 100.0  # C₂ over the range of temperatures, beyond which WLF is a straight line


@dataclass(frozen=True)
class Wlf:
    """log₁₀ a_T = −C₁ (T − T_r)/(C₂ + T − T_r) (Williams, Landel and Ferry 1955).

    Parameters
    ----------
    c1 : float
    c2 : float, K
    reference : float, K
    """

    c1: float
    c2: float
    reference: float

    def log_shift(self, temperature: np.ndarray) -> np.ndarray:
        """log₁₀ a_T at temperatures (K) above T_r − C₂."""
        above = np.asarray(temperature, float) - self.reference
        return -self.c1 * above / (self.c2 + above)


@dataclass(frozen=True)
class Arrhenius:
    """log₁₀ a_T = E_a/(R ln 10) (1/T − 1/T_r).

    Parameters
    ----------
    energy : float, J/mol; activation energy
    reference : float, K
    """

    energy: float
    reference: float

    def log_shift(self, temperature: np.ndarray) -> np.ndarray:
        """log₁₀ a_T at temperatures (K)."""
        return self.energy / (GAS_CONSTANT * LN10) * (1 / np.asarray(temperature, float) - 1 / self.reference)


@dataclass(frozen=True)
class ShiftLaw:
    """A law fitted to free shifts.

    Parameters
    ----------
    law : Wlf or Arrhenius
    interval : name of a constant → (low, high) of 95 %
    rms : float; of log₁₀ a_T about the law, the reference left out
    """

    law: Wlf | Arrhenius
    interval: dict[str, tuple[float, float]]
    rms: float


def fit_arrhenius(curve: MasterCurve) -> ShiftLaw:
    """The activation energy, by generalised least squares of the free shifts."""
    free = curve.temperature != curve.reference
    slope = Arrhenius(1.0, curve.reference).log_shift(curve.temperature[free])[:, None]
    root = _whitening(curve, free)
    wanted = root @ curve.log_shift[free]
    design = root @ slope
    energy = float((design.T @ wanted)[0] / (design.T @ design)[0, 0])
    half = float(_halves(design, wanted - design[:, 0] * energy, curve.degrees)[0])
    law = Arrhenius(energy, curve.reference)
    return ShiftLaw(law, {"energy": (energy - half, energy + half)}, _rms(curve, law))


def fit_wlf(curve: MasterCurve) -> ShiftLaw:
    """C₁ and C₂ by generalised least squares of the free shifts, from the line (T − T_r)/log a_T.

    Raises
    ------
    InputError
        with fewer than three temperatures; and where the shifts bend the other way, towards Arrhenius or
        beyond, so that C₁ and C₂ grow together without end
    """
    free = curve.temperature != curve.reference
    if free.sum() < 2:
        raise InputError("WLF has two constants: it needs three temperatures or more")
    above = curve.temperature[free] - curve.reference
    root = _whitening(curve, free)
    coldest = float(min(above.min(), 0.0))
    c1, c2 = _start(above, curve.log_shift[free], coldest)

    def residual(theta: np.ndarray) -> np.ndarray:
        return root @ (-np.exp(theta[0]) * above / (np.exp(theta[1]) - coldest + above) - curve.log_shift[free])

    first = np.clip(np.log([c1, c2 + coldest]), [-9.0, -4.0], [19.0, 14.0])
    found = least_squares(residual, first, bounds=([-10.0, -5.0], [20.0, 15.0]), xtol=1e-12, ftol=1e-14)
    c1, c2 = float(np.exp(found.x[0])), float(np.exp(found.x[1])) - coldest
    if c2 > FLATTEST * np.ptp(curve.temperature):
        raise InputError("the shifts do not bend as WLF does: C₁ and C₂ cannot be told apart")
    half = _halves(found.jac, found.fun, curve.degrees)
    law = Wlf(c1, c2, curve.reference)
    factor = np.exp(half)  # of C₁, and of C₂ over the coldest: fitted as logarithms
    pole = (c2 + coldest) / float(factor[1]), (c2 + coldest) * float(factor[1])
    interval = {
        "c1": (c1 / float(factor[0]), c1 * float(factor[0])),
        "c2": (pole[0] - coldest, pole[1] - coldest),
    }
    return ShiftLaw(law, interval, _rms(curve, law))


def _start(above: np.ndarray, shift: np.ndarray, coldest: float) -> tuple[float, float]:
    """C₁ and C₂ of the line −(T − T_r)/log a_T = C₂/C₁ + (T − T_r)/C₁, kept inside its domain."""
    used = np.abs(shift) > 1e-9
    if used.sum() >= 2:
        slope, level = np.polyfit(above[used], -above[used] / shift[used], 1)
        if slope > 0 and level > 0 and level / slope + coldest > 0.1:
            return 1 / slope, level / slope
    return 20.0, 150.0 - coldest


def _whitening(curve: MasterCurve, free: np.ndarray) -> np.ndarray:
    """W with WᵀW the inverse covariance of the free shifts; equal weights where they have no scatter at all."""
    covariance = curve.covariance[np.ix_(free, free)]
    scale = float(np.trace(covariance)) / covariance.shape[0]
    if scale < 1e-24:
        return np.eye(covariance.shape[0])
    return np.linalg.inv(np.linalg.cholesky(covariance + 1e-9 * scale * np.eye(covariance.shape[0])))


def _halves(design: np.ndarray, residual: np.ndarray, degrees: int) -> np.ndarray:
    """Half widths of 95 % intervals; whitened scatter above 1 counts: the law is then no exact one."""
    spare = design.shape[0] - design.shape[1]
    scatter = max(float(residual @ residual) / spare, 1.0) if spare else 1.0
    point = student.ppf((1 + CONFIDENCE) / 2, spare if scatter > 1 else max(degrees, 1))
    return point * np.sqrt(scatter * np.diag(np.linalg.pinv(design.T @ design)))


def _rms(curve: MasterCurve, law: Wlf | Arrhenius) -> float:
    free = curve.temperature != curve.reference
    return float(np.sqrt(np.mean((law.log_shift(curve.temperature[free]) - curve.log_shift[free]) ** 2)))
