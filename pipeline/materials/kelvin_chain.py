"""Creep compliance as a Kelvin chain: spring, dashpot and retarded springs one after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.materials.prony import refuse_terms


@dataclass(frozen=True)
class KelvinChain:
    """D(t) = D_0 + φ t + Σ D_j (1 − exp(−t/τ_j)).

    Parameters
    ----------
    instantaneous : float, 1/Pa, positive; D_0
    fluidity : float, 1/(Pa s), zero or positive; φ = 1/η of the dashpot
    compliance : (k,) array, 1/Pa, positive
    time : (k,) array, s, positive; retardation times, increasing
    """

    instantaneous: float
    fluidity: float
    compliance: np.ndarray
    time: np.ndarray

    def __post_init__(self) -> None:
        compliance, time = (np.array(getattr(self, name), float, ndmin=1) for name in ("compliance", "time"))
        if compliance.size or time.size:
            refuse_terms("compliance", compliance, time, "1/Pa")
        if not (np.isfinite(self.instantaneous) and self.instantaneous > 0):
            raise InputError(f"instantaneous compliance {self.instantaneous:g} 1/Pa must be positive and finite")
        if not (np.isfinite(self.fluidity) and self.fluidity >= 0):
            raise InputError(f"fluidity {self.fluidity:g} 1/(Pa s) must be zero or positive, and finite")
        order = np.argsort(time)
        for name, values in (("compliance", compliance[order]), ("time", time[order])):
            object.__setattr__(self, name, values)

    def creep_compliance(self, time: np.ndarray) -> np.ndarray:
        """D (1/Pa) at times (s) of any shape, not negative."""
        time = np.asarray(time, float)
        retarded = -np.expm1(-time[..., None] / self.time) @ self.compliance
        return self.instantaneous + self.fluidity * time + retarded

    def laplace(self, s: np.ndarray) -> np.ndarray:
        """D̃ (s/Pa) at s (1/s): D_0/s + φ/s² + Σ D_j/(s (1 + s τ_j))."""
        s = np.asarray(s)
        return (
            self.instantaneous / s + self.fluidity / s**2 + (1 / (1 + s[..., None] * self.time)) @ self.compliance / s
        )

    def averaged(self, other: KelvinChain) -> KelvinChain:
        """The mean of two compliances: a bond half of one material, half of the other."""
        return KelvinChain(
            (self.instantaneous + other.instantaneous) / 2,
            (self.fluidity + other.fluidity) / 2,
            np.concatenate([self.compliance, other.compliance]) / 2,
            np.concatenate([self.time, other.time]),
        )

    def shifted(self, factor: float) -> KelvinChain:
        """The chain with every time multiplied: at another temperature, a_T of it over this one's."""
        return KelvinChain(self.instantaneous, self.fluidity / factor, self.compliance, factor * self.time)


def elastic(modulus: float) -> KelvinChain:
    """A chain that is only its first spring, of the given modulus (Pa)."""
    if not (np.isfinite(modulus) and modulus > 0):
        raise InputError(f"modulus = {modulus:g} Pa must be positive and finite")
    return KelvinChain(1 / modulus, 0.0, np.zeros(0), np.zeros(0))
