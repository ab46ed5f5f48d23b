"""Cohesive bonds whose strength depends on how fast they open."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipeline.materials.cohesive import CentralSoftening, Factor

LEAST = 0.05  # of the strength at the mouth's rate: a bond that hardly opens keeps so much


@dataclass(frozen=True)
class RateSoftening:
    """Bonds with the strength f_max (1 + value × log₁₀(opening rate of the bond / rate of the mouth)).

    What is asked of the law is answered at the rate of the mouth. K^n and δ_max do not depend on the rate. No engine
    follows it as it is: at given rates it is a law that depends on the opening alone (`at`).

    Parameters
    ----------
    law : CentralSoftening; at the rate of the mouth
    per_decade : float; relative change of strength per decade
    """

    law: CentralSoftening
    per_decade: float

    @property
    def k_n(self) -> np.ndarray:
        return self.law.k_n

    @property
    def f_max(self) -> np.ndarray:
        return self.law.f_max

    @property
    def delta_max(self) -> np.ndarray:
        return self.law.delta_max

    @property
    def delta_peak(self) -> np.ndarray:
        return self.law.delta_peak

    @property
    def delta_end(self) -> np.ndarray:
        return self.law.delta_end

    def dissipated(self, reached: np.ndarray) -> np.ndarray:
        """Energy (m,), J, that bonds opened to `reached` (m,), m, at the rate of the mouth have used up."""
        return self.law.dissipated(reached)

    def at(self, decades: np.ndarray) -> CentralSoftening:
        """The law of bonds that open faster than the mouth by so many decades (m,)."""
        return self.law.times(1.0, np.maximum(1 + self.per_decade * decades, LEAST), 1.0)

    def times(self, stiffness: Factor, strength: Factor, opening: Factor) -> Self:
        """The law with stiffness, strength and last opening of every bond multiplied, each by a number or (m,)."""
        return replace(self, law=self.law.times(stiffness, strength, opening))

    def spared(self, bonds: np.ndarray) -> Self:
        """The law with some bonds (m,) bool that take no damage."""
        return replace(self, law=self.law.spared(bonds))
