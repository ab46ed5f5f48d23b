"""Relaxation modulus as a Prony series: springs and dashpots in Maxwell arms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError


@dataclass(frozen=True)
class PronySeries:
    """E(t) = E_∞ + Σ E_i exp(−t/τ_i); the same numbers in N/m describe a bond.

    Parameters
    ----------
    infinity : float, Pa; the modulus that is left, 0 for a material that flows
    modulus : (k,) array, Pa, positive
    time : (k,) array, s, positive; relaxation times, increasing
    """

    infinity: float
    modulus: np.ndarray
    time: np.ndarray

    def __post_init__(self) -> None:
        modulus, time = (np.array(getattr(self, name), float, ndmin=1) for name in ("modulus", "time"))
        refuse_terms("modulus", modulus, time, "Pa")
        if not (np.isfinite(self.infinity) and self.infinity >= 0):
            raise InputError(f"infinity = {self.infinity:g} Pa must be zero or positive: what is left of the modulus")
        order = np.argsort(time)
        for name, values in (("modulus", modulus[order]), ("time", time[order])):
            object.__setattr__(self, name, values)

    @property
    def instantaneous(self) -> float:
        """E(0) (Pa)."""
        return float(self.infinity + self.modulus.sum())

    @property
    def viscosity(self) -> float:
        """Σ E_i τ_i (Pa s): of the steady flow where E_∞ = 0."""
        return float(self.modulus @ self.time)

    def relaxation_modulus(self, time: np.ndarray) -> np.ndarray:
        """E (Pa) at times (s) of any shape, not negative."""
        decay = np.exp(-np.asarray(time, float)[..., None] / self.time)
        return self.infinity + decay @ self.modulus

    def complex_modulus(self, frequency: np.ndarray) -> np.ndarray:
        """E* = E' + iE'' (Pa) at angular frequencies (rad/s): E_∞ + Σ E_i iωτ_i/(1 + iωτ_i)."""
        turn = 1j * np.asarray(frequency, float)[..., None] * self.time
        return self.infinity + (turn / (1 + turn)) @ self.modulus

    def laplace(self, s: np.ndarray) -> np.ndarray:
        """Ẽ (Pa s) at s (1/s): E_∞/s + Σ E_i/(s + 1/τ_i)."""
        s = np.asarray(s)
        return self.infinity / s + (1 / (s[..., None] + 1 / self.time)) @ self.modulus

    def scaled(self, factor: float) -> PronySeries:
        """The same times with every modulus multiplied: a bond's K(t) from E(t), at constant Poisson's ratio."""
        return PronySeries(factor * self.infinity, factor * self.modulus, self.time)

    def shifted(self, factor: float) -> PronySeries:
        """The series with every time multiplied: at another temperature, a_T of it over this one's."""
        return PronySeries(self.infinity, self.modulus, factor * self.time)


def refuse_terms(name: str, size: np.ndarray, time: np.ndarray, unit: str) -> None:
    """Refuse terms of a series that are not positive numbers, or not as many as their times."""
    if size.ndim != 1 or size.shape != time.shape or not size.size:
        raise InputError(f"{size.size} values of {name} for {time.size} times: a series needs as many, at least one")
    for what, values, its_unit in ((name, size, unit), ("time", time, "s")):
        good = np.isfinite(values) & (values > 0)
        if not good.all():
            raise InputError(
                f"{what} = {values[~good][0]:g} {its_unit} of a series must be finite and positive: leave out terms "
                "that are zero, fit negative ones anew (fit_relaxation)"
            )
