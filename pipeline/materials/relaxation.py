"""Forces of viscoelastic bonds step by step: exact for openings that grow linearly in time, any length of step.

The history of a bond with stiffness K(t) = K_∞ + Σ K_i exp(−t/τ_i) is one force h_i an arm. With v = Δδ/Δt
and x_i = Δt/τ_i each arm obeys ḣ = K_i v − h/τ_i, so after the step (Taylor, Pister and Goudreau 1970)

    h_i ← exp(−x_i) h_i + K_i φ(x_i) Δδ,     φ(x) = (1 − exp(−x))/x,     f = K_∞ δ + Σ h_i.

Δt is *physical* time. A jump is a step with Δt = 0. State in, state out: nothing is kept here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.core.errors import InputError
from pipeline.materials.prony import PronySeries


@dataclass(frozen=True)
class Arms:
    """Maxwell arms of many bonds.

    Parameters
    ----------
    stiffness : (m, k) array, N/m, zero or positive; K_i
    time : (m, k) array, s, positive; τ_i
    left : (m,) array, N/m, zero or positive; K_∞
    """

    stiffness: np.ndarray
    time: np.ndarray
    left: np.ndarray

    @cached_property
    def instantaneous(self) -> np.ndarray:
        """K(0) (m,), N/m."""
        return self.left + self.stiffness.sum(axis=1)

    def relaxed(self) -> np.ndarray:
        """Arm forces (m, k), N, of bonds that have never been loaded."""
        return np.zeros_like(self.stiffness)


def arms(series: PronySeries, per_modulus: np.ndarray) -> Arms:
    """The arms of m bonds of one material: K(t) ∝ E(t), Poisson's ratio being constant.

    Parameters
    ----------
    series : PronySeries, of E(t)
    per_modulus : (m,) array, m; bond stiffness over modulus, `normal_stiffness(1.0, …)`
    """
    share = np.asarray(per_modulus, float)
    time = np.broadcast_to(series.time, (share.size, series.time.size))
    return Arms(np.multiply.outer(share, series.modulus), time, share * series.infinity)


def relax(bonds: Arms, force: np.ndarray, opening: np.ndarray, duration: float) -> np.ndarray:
    """Arm forces (m, k), N, after the openings have changed by `opening` (m,), m, within `duration` s.

    Parameters
    ----------
    bonds : Arms
    force : (m, k) array, N; arm forces before, not changed
    opening : (m,) array, m; change of opening, linear in time
    duration : float, s, zero or positive

    Raises
    ------
    InputError
        for a duration below zero
    """
    x = _steps(bonds, duration)
    return np.exp(-x) * force + bonds.stiffness * ramp(x) * np.asarray(opening)[:, None]


def tangent(bonds: Arms, duration: float) -> np.ndarray:
    """∂f/∂δ (m,), N/m, at the end of a step of `duration` s: K_∞ + Σ K_i φ(x_i); K(0) for a jump."""
    return bonds.left + _over_arms(bonds.stiffness, ramp(_steps(bonds, duration)))


def history_force(bonds: Arms, force: np.ndarray, duration: float) -> np.ndarray:
    """Force (m,), N, that the arms would still carry after `duration` s at constant opening."""
    return _over_arms(np.exp(-_steps(bonds, duration)), force)


def total(bonds: Arms, force: np.ndarray, opening: np.ndarray) -> np.ndarray:
    """Force of the bonds (m,), N, from arm forces (m, k), N, and the whole opening (m,), m."""
    return bonds.left * opening + np.einsum("mk->m", force)


def stored(bonds: Arms, force: np.ndarray, opening: np.ndarray) -> np.ndarray:
    """Recoverable energy (m,), J, of the springs: ½ K_∞ δ² + Σ h_i²/(2 K_i)."""
    springs = np.divide(force**2, 2 * bonds.stiffness, out=np.zeros_like(force), where=bonds.stiffness > 0)
    return 0.5 * bonds.left * np.asarray(opening) ** 2 + springs.sum(axis=1)


def crept(bonds: Arms, force: np.ndarray, opening: np.ndarray, duration: float) -> np.ndarray:
    """Energy (m,), J, that the dashpots use up in a step: Σ ∫ h_i²/(K_i τ_i) dt, in closed form.

    With h = a e^(−t/τ) + b, b = K τ v, a = h_before − b it is (a² (1 − e^(−2x))/2 + 2ab (1 − e^(−x)) + b² x)/K,
    written in h_before and Δδ so that short steps lose no digits. Arguments as in `relax`.
    """
    x = _steps(bonds, duration)
    kept = np.divide(force**2, bonds.stiffness, out=np.zeros_like(force), where=bonds.stiffness > 0)
    step = np.asarray(opening)[:, None]
    double = ramp(2 * x)
    own = kept * x * double
    mixed = 2 * force * step * (ramp(x) - double)
    grown = bonds.stiffness * step**2 * _growth(x)
    return np.sum(own + mixed + grown, axis=1)


def ramp(x: np.ndarray) -> np.ndarray:
    """φ(x) = (1 − e^(−x))/x, 1 at x = 0."""
    return np.divide(-np.expm1(-x), x, out=np.ones_like(x), where=x != 0)


def _over_arms(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Σ over the arms of products (m, k) → (m,); `sum(axis=1)` is slow along so short an axis."""
    return np.einsum("mk,mk->m", first, second)


def _growth(x: np.ndarray) -> np.ndarray:
    """(1 − 2φ(x) + φ(2x))/x = x/3 − x²/4 + …: by its series where the difference would lose digits."""
    small = x < 0.5
    near, far = np.where(small, x, 0.0), np.where(small, 1.0, x)
    series, term = np.zeros_like(near), np.ones_like(near)
    for n in range(1, 19):
        term = term * (-near) / (n + 1)  # (−x)ⁿ/(n + 1)!
        series += term * (2.0**n - 2)
    exact = (1 - 2 * ramp(far) + ramp(2 * far)) / far
    return np.where(small, np.divide(series, near, out=np.zeros_like(near), where=near != 0), exact)


def _steps(bonds: Arms, duration: float) -> np.ndarray:
    if not duration >= 0:
        raise InputError(f"a step of {duration:g} s: physical time does not run backwards")
    return duration / bonds.time
