"""Exact interconversion of relaxation modulus and creep compliance: s² Ẽ(s) D̃(s) = 1.

sẼ and sD̃ of positive series are rational functions whose zeros and poles alternate on the negative real
axis, so each zero is found between two known poles, and its residue is positive (Park and Schapery 1999,
Int. J. Solids Struct. 36, 1653; Gross 1953). No fit, no collocation.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from pipeline.core.errors import InputError
from pipeline.materials.kelvin_chain import KelvinChain
from pipeline.materials.prony import PronySeries

Function = Callable[[float, np.ndarray], float]  # of a rate x and of 1 − xτ of every term
SHORTEST = -80.0  # logarithm of the shortest distance to a pole that is looked at, over half the interval


def relaxation_of(chain: KelvinChain) -> PronySeries:
    """The relaxation modulus of a creep compliance.

    With s = −x, sD̃ = D_0 − φ/x + Σ D_j/(1 − xτ_j) grows from −∞ to +∞ between its poles; each zero x_i is
    a rate, 1/(x_i d(sD̃)/dx) the modulus of its arm. A chain that flows has one arm more than retarded
    springs and E_∞ = 0, one that does not has as many, and E_∞ = 1/D(∞).
    """
    size, time = _merged(chain.compliance, chain.time)
    if not size.size and not chain.fluidity:
        raise InputError("a chain that is only a spring does not relax and has no arms: use its modulus")

    def value(x: float, gap: np.ndarray) -> float:
        return chain.instantaneous - chain.fluidity / x + float(np.sum(size / gap))

    def arm(x: float, gap: np.ndarray) -> float:
        return 1 / (chain.fluidity / x + x * float(np.sum(size * time / gap**2)))

    edges = [*([_below(time, chain)] if chain.fluidity else []), *(1 / time[::-1]), _beyond(time, chain)]
    rate, modulus = _zeros(value, arm, time, edges)
    left = 0.0 if chain.fluidity else 1 / (chain.instantaneous + size.sum())
    return PronySeries(left, modulus, 1 / rate)


def compliance_of(series: PronySeries) -> KelvinChain:
    """The creep compliance of a relaxation modulus.

    With s = −x, sẼ = E_∞ − Σ E_i xτ_i/(1 − xτ_i) falls from +∞ to −∞ between its poles; each zero x_j is a
    rate of retardation, −1/(x_j d(sẼ)/dx) its compliance. Where E_∞ = 0 the material flows with φ = 1/Σ E_i τ_i.
    """
    size, time = _merged(series.modulus, series.time)

    def value(x: float, gap: np.ndarray) -> float:
        return float(np.sum(size * x * time / gap)) - series.infinity

    def spring(x: float, gap: np.ndarray) -> float:
        return 1 / (x * float(np.sum(size * time / gap**2)))

    slowest = series.infinity / (series.infinity * time[-1] + series.viscosity) / 2  # sẼ > 0 up to here
    rate, compliance = _zeros(value, spring, time, [*([slowest] if series.infinity else []), *(1 / time[::-1])])
    fluidity = 0.0 if series.infinity else 1 / series.viscosity
    return KelvinChain(1 / series.instantaneous, fluidity, compliance, 1 / rate)


def _merged(size: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Terms of the same time as one: two poles at one place are one pole."""
    times, group = np.unique(time, return_inverse=True)
    return np.bincount(group, size, times.size), times


def _below(time: np.ndarray, chain: KelvinChain) -> float:
    """A rate at which sD̃ of a flowing chain is negative: below half the slowest pole 1/(1 − xτ) is at most 2."""
    slowest = chain.fluidity * float(time[-1]) if time.size else 0.0
    return 0.5 * chain.fluidity / (chain.instantaneous + 2 * float(chain.compliance.sum()) + slowest)


def _beyond(time: np.ndarray, chain: KelvinChain) -> float:
    """A rate at which sD̃ is positive and stays so: beyond twice the fastest pole 1/(1 − xτ) ≥ −2/(xτ)."""
    fastest = 2 / float(time[0]) if time.size else 0.0
    return fastest + 4 * (chain.fluidity + float(np.sum(chain.compliance / chain.time))) / chain.instantaneous


def _zeros(value: Function, weight: Function, time: np.ndarray, edges: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Zeros (k − 1,) of a function that rises from edge to edge (k), and the weight of each."""
    found = [_zero(value, time, a, b) for a, b in pairwise(edges)]
    return np.array([x for x, _ in found]), np.array([weight(x, gap) for x, gap in found])


def _zero(value: Function, time: np.ndarray, low: float, high: float) -> tuple[float, np.ndarray]:
    """The one zero of a rising function between two rates, and 1 − xτ there to full precision.

    Sought as the logarithm of its distance to the nearer edge: at a pole 1 − xτ is then no difference of
    near numbers, however small the weight of that pole.
    """
    middle = float(np.sqrt(low * high))
    base, way = (low, middle - low) if value(middle, 1 - middle * time) > 0 else (high, middle - high)
    at_base = 1 - base * time
    at_base[np.abs(at_base) < 4 * np.finfo(float).eps] = 0.0  # this pole: 1/τ is rounded

    def at(u: float) -> tuple[float, np.ndarray]:
        step = way * float(np.exp(u))
        return base + step, at_base - step * time

    if value(*at(SHORTEST)) * way >= 0:  # a pole of hardly any weight
        return at(SHORTEST)
    if value(*at(0.0)) * way <= 0:  # the middle itself, within a rounding
        return at(0.0)
    return at(brentq(lambda u: value(*at(u)), SHORTEST, 0.0, xtol=1e-15, rtol=1e-15))
