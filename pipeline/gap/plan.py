"""The plan of a fracture test as effects change it: no lattice yet, so that any kind of model can be built from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pipeline.core.specimen import Specimen
from pipeline.materials.mixture import Mixture


@dataclass(frozen=True)
class Place:
    """Where bonds are and what they are made of.

    Parameters
    ----------
    middle : (m, 2) array, m; specimen coordinates
    phase : (m,) array of bond phases
    specimen : Specimen
    """

    middle: np.ndarray
    phase: np.ndarray
    specimen: Specimen


@dataclass(frozen=True)
class Factors:
    """What K^n, f_max and δ_max of bonds are multiplied by; numbers or (m,) arrays."""

    stiffness: np.ndarray | float = 1.0
    strength: np.ndarray | float = 1.0
    opening: np.ndarray | float = 1.0


class BondChange(Protocol):
    """A change of bonds that depends on where they are; a frozen dataclass, so that it can be kept and compared."""

    def factors(self, place: Place) -> Factors: ...


@dataclass(frozen=True)
class Plan:
    """What a test is built from.

    A builder that cannot follow a field that is set refuses it (`UnavailableError`): nothing is silently left out.

    Parameters
    ----------
    specimen : Specimen
    mixture : Mixture; material, softening and ratios
    bonds : tuple of BondChange
    spent : float; share of the softening branch that bonds near the tip have behind them at the start
    spent_radius : float, m; how near
    void_share : float; of the area, in voids that no image shows
    eccentricity : float, m; of the load, from the notch line
    friction : float; Coulomb coefficient at supports or pins
    creep : float; share of D(t) − D(0) of the mastic that is left out
    strength_per_decade : float; relative change of strength per decade of opening rate
    """

    specimen: Specimen
    mixture: Mixture
    bonds: tuple[BondChange, ...] = ()
    spent: float = 0.0
    spent_radius: float = 3e-3
    void_share: float = 0.0
    eccentricity: float = 0.0
    friction: float = 0.0
    creep: float = 0.0
    strength_per_decade: float = 0.0

    def with_bonds(self, change: BondChange) -> Plan:
        """With one more change of bonds."""
        return replace(self, bonds=(*self.bonds, change))

    def factors(self, place: Place) -> Factors:
        """All changes of bonds together; (m,) arrays."""
        found = [change.factors(place) for change in self.bonds]
        one = np.ones(len(place.middle))
        names = ("stiffness", "strength", "opening")
        return Factors(*(one * np.prod([getattr(f, n) * one for f in found] or [one], axis=0) for n in names))
