"""A mixture of stone and mastic: from the two unknowns to the properties of every bond."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.particles import Bonds, Phase
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.elastic import Plane, normal_stiffness, series, stiffness_ratio
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.softening import LINEAR, Softening, Unloading


@dataclass(frozen=True)
class Mixture:
    """Stiffness and strength of the phases relative to the mastic (Hill et al. 2017, after Kim et al. 2008).

    Parameters
    ----------
    mastic_modulus, aggregate_modulus : float, Pa
    poissons_ratio : float
    plane : Plane
    f_max_start, delta_max_start : float, N and m; what the aggregate's ratios refer to
    interface_strength_ratio, interface_opening_ratio : float; of the mastic's current f_max and delta_max
    aggregate_strength_ratio, aggregate_opening_ratio : float; of the start values
    aggregate_follows : bool; the aggregate's ratios refer to the current values instead
    touching : strength of bonds between two touching stones: of the "interface" or of the "aggregate"
    shear_strength_ratio, shear_opening_ratio : float; of sliding to opening, where ν gives the bonds a K^s
    softening : Softening
    unloading : Unloading
    friction : float; Coulomb coefficient of failed bonds, where there is a K^s
    """

    mastic_modulus: float
    aggregate_modulus: float
    poissons_ratio: float
    plane: Plane
    f_max_start: float
    delta_max_start: float
    interface_strength_ratio: float = 0.95
    interface_opening_ratio: float = 0.30
    aggregate_strength_ratio: float = 3.0
    aggregate_opening_ratio: float = 1.0
    aggregate_follows: bool = False
    touching: Literal["interface", "aggregate"] = "interface"
    shear_strength_ratio: float = 1.0
    shear_opening_ratio: float = 1.0
    softening: Softening = LINEAR
    unloading: Unloading = Unloading.SECANT
    friction: float = 0.0

    @property
    def shear_ratio(self) -> float:
        """K^s/K^n of every bond, 0 where the bonds are central forces."""
        return stiffness_ratio(self.poissons_ratio, self.plane)

    def stiffness(self, phase: np.ndarray, thickness: float) -> np.ndarray:
        """K^n (m,) in N/m of hexagonal-lattice bonds of the given phases; interface: both in series."""
        mastic, aggregate = (
            normal_stiffness(modulus, self.poissons_ratio, self.plane, thickness)
            for modulus in (self.mastic_modulus, self.aggregate_modulus)
        )
        table = {
            Phase.MASTIC: mastic,
            Phase.AGGREGATE: aggregate,
            Phase.INTERFACE: series(mastic, aggregate),
            Phase.TOUCHING: aggregate,
        }
        return _look_up(table, phase)

    def strength(self, phase: np.ndarray, f_max: float, delta_max: float) -> tuple[np.ndarray, np.ndarray]:
        """f_max (m,) in N and delta_max (m,) in m of bonds, from the mastic's current values."""
        base = (f_max, delta_max) if self.aggregate_follows else (self.f_max_start, self.delta_max_start)
        aggregate = (self.aggregate_strength_ratio * base[0], self.aggregate_opening_ratio * base[1])
        interface = (self.interface_strength_ratio * f_max, self.interface_opening_ratio * delta_max)
        rows = {
            Phase.MASTIC: (f_max, delta_max),
            Phase.AGGREGATE: aggregate,
            Phase.INTERFACE: interface,
            Phase.TOUCHING: aggregate if self.touching == "aggregate" else interface,
        }
        force, opening = ({p: row[k] for p, row in rows.items()} for k in (0, 1))
        return _look_up(force, phase), _look_up(opening, phase)

    def law(self, bonds: Bonds, thickness: float, f_max: float, delta_max: float) -> CentralSoftening | MixedSoftening:
        """The law of every bond of a hexagonal lattice; protected bonds take no damage.

        `LinearSoftening` where bonds are central forces with linear softening and secant unloading,
        `CentralSoftening` with other options, `MixedSoftening` where ν gives them a shear stiffness.

        Parameters
        ----------
        bonds : Bonds
        thickness : float, m
        f_max : float, N; of the mastic
        delta_max : float, m; of the mastic

        Raises
        ------
        InputError
            for options of sliding where bonds carry no shear
        """
        force, opening = self.strength(bonds.phase, f_max, delta_max)
        free = ~bonds.protected
        force, opening = np.where(free, force, np.inf), np.where(free, opening, np.inf)
        return self.bond_law(self.stiffness(bonds.phase, thickness), force, opening)

    def bond_law(
        self, stiffness: np.ndarray, force: np.ndarray, opening: np.ndarray
    ) -> CentralSoftening | MixedSoftening:
        """The law of bonds with K^n (m,), N/m, f_max (m,), N, and delta_max (m,), m, on any network; as `law`."""
        ratio = self.shear_ratio
        if not ratio:
            self._refuse_sliding()
            if self.softening == LINEAR and self.unloading is Unloading.SECANT:
                return LinearSoftening(stiffness, force, opening)
            return CentralSoftening(stiffness, force, opening, self.softening, self.unloading)
        return MixedSoftening(
            k_n=stiffness,
            k_s=ratio * stiffness,
            f_max=force,
            f_shear=self.shear_strength_ratio * force,
            delta_max=opening,
            delta_shear=self.shear_opening_ratio * opening,
            softening=self.softening,
            unloading=self.unloading,
            friction=self.friction,
        )

    def _refuse_sliding(self) -> None:
        """Refuse what would have no effect: without K^s bonds carry no shear."""
        inert = {"shear_strength_ratio": 1.0, "shear_opening_ratio": 1.0, "friction": 0.0}
        for name, none in inert.items():
            value = getattr(self, name)
            if value != none:
                raise InputError(
                    f"{name} = {value:g} has no effect at poissons_ratio = {self.poissons_ratio:g} in plane "
                    f"{self.plane}: bonds carry no shear there (K^s = 0); leave it at {none:g}"
                )


def _look_up(table: dict[Phase, float], phase: np.ndarray) -> np.ndarray:
    unknown = set(np.unique(phase).tolist()) - {int(p) for p in table}
    if unknown:
        raise InputError(f"a bond cannot be of phase {sorted(unknown)}: it must be one of {[p.name for p in table]}")
    values = np.zeros(max(table) + 1)
    for key, value in table.items():
        values[key] = value
    return values[phase]
