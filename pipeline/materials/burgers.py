"""The Burgers model: a Maxwell and a Kelvin element one after the other, four constants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.materials.kelvin_chain import KelvinChain
from pipeline.materials.prony import PronySeries


@dataclass(frozen=True)
class Burgers:
    """D(t) = D₁ + t/η₁ + D₂ (1 − exp(−t/τ₂)), Hill et al. 2017 eq. (1).

    Parameters
    ----------
    d1 : float, 1/Pa; of the spring, 1/E_M
    d2 : float, 1/Pa; of the retarded spring
    eta1 : float, Pa s; of the dashpot, η_M
    tau2 : float, s; retardation time, not a relaxation time

    Raises
    ------
    InputError
        for a constant that is not positive and finite
    """

    d1: float
    d2: float
    eta1: float
    tau2: float

    def __post_init__(self) -> None:
        for name, unit in (("d1", "1/Pa"), ("d2", "1/Pa"), ("eta1", "Pa s"), ("tau2", "s")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"{name} = {value:g} {unit} of a Burgers model must be positive and finite")

    @property
    def chain(self) -> KelvinChain:
        """The same as a Kelvin chain."""
        return KelvinChain(self.d1, 1 / self.eta1, np.array([self.d2]), np.array([self.tau2]))

    def like(self, modulus: float, share: float = 1.0) -> Burgers:
        """Another short-term modulus, Pa, and a share of the growth: D = (1 + share (D(t)/D₁ − 1))/modulus."""
        growth = share / (modulus * self.d1)
        return Burgers(1 / modulus, growth * self.d2, self.eta1 / growth, self.tau2)

    def creep_compliance(self, time: np.ndarray) -> np.ndarray:
        """D (1/Pa) at times (s) of any shape, not negative."""
        return self.chain.creep_compliance(time)

    def relaxation(self) -> PronySeries:
        """E(t) = E_f exp(−t/τ_f) + E_s exp(−t/τ_s), the exact interconversion; E(∞) = 0.

        From Ẽ(s) = η₁(1 + τ₂s)/(D₁η₁τ₂s² + (D₁η₁ + τ₂ + D₂η₁)s + 1). With g = D₁η₁ − τ₂ + D₂η₁ and
        w² = g² + 4D₂η₁τ₂ the times are τ_s = (g + w)/2 + τ₂ > τ₂ > τ_f = D₁η₁τ₂/τ_s, so both are real and
        both weights η₁(τ_s − τ₂)/(τ_s w), η₁(τ₂ − τ_f)/(τ_f w) positive; no difference of near numbers is taken.
        """
        retarded = 4 * self.d2 * self.eta1 * self.tau2
        g = self.d1 * self.eta1 - self.tau2 + self.d2 * self.eta1
        w = float(np.hypot(g, np.sqrt(retarded)))
        above = (g + w) / 2 if g > 0 else retarded / (2 * (w - g))  # τ_s − τ₂
        below = (w - g) / 2 if g < 0 else retarded / (2 * (w + g))  # τ₂ − τ_f
        slow = above + self.tau2
        fast = self.d1 * self.eta1 * self.tau2 / slow
        modulus = np.array([self.eta1 * below / (fast * w), self.eta1 * above / (slow * w)])
        return PronySeries(0.0, modulus, np.array([fast, slow]))

    def relaxation_modulus(self, time: np.ndarray) -> np.ndarray:
        """E (Pa) at times (s) of any shape, not negative."""
        return self.relaxation().relaxation_modulus(time)

    def averaged_with_elastic(self, modulus: float) -> Burgers:
        """The interface with a stone of this modulus (Pa): the mean of the two *compliances*, again Burgers.

        D = ½ (D_mastic(t) + 1/E): half of the bond creeps, half does not; at t = 0 the two stiffnesses in series.
        """
        if not (np.isfinite(modulus) and modulus > 0):
            raise InputError(f"modulus = {modulus:g} Pa of the aggregate must be positive and finite")
        return Burgers((self.d1 + 1 / modulus) / 2, self.d2 / 2, 2 * self.eta1, self.tau2)

    def shifted(self, factor: float) -> Burgers:
        """The model with its times multiplied: at another temperature, a_T of it over this one's."""
        return Burgers(self.d1, self.d2, factor * self.eta1, factor * self.tau2)
