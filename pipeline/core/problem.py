"""Problem in, solution out: the seam between the engines and everything else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol, runtime_checkable

import numpy as np

from pipeline.core.clock import Clock
from pipeline.core.curve import LoadCurve
from pipeline.core.particles import Bonds, Particles
from pipeline.core.specimen import Specimen


class Kinematics(StrEnum):
    """How bond openings are measured: against the reference direction, or by true lengths."""

    SMALL = "small"
    FINITE = "finite"


class Role(StrEnum):
    """What a grip does for the machine load."""

    DRIVE = "drive"  # moves with the machine; its reaction is the load
    REACT = "react"  # held; its reaction balances the load
    GUIDE = "guide"  # held; only stops rigid motion


class BondLaw(Protocol):
    """What everybody may ask of the law of the bonds; arrays are (m,), one entry a bond.

    k_n in N/m, f_max in N (inf: takes no damage), delta_max in m, delta_peak in m; delta_end in m, the opening at which
    nothing is left. `dissipated`: J, as if the bond had been opened to `reached` (m) and nothing else.
    """

    @property
    def k_n(self) -> np.ndarray: ...
    @property
    def f_max(self) -> np.ndarray: ...
    @property
    def delta_max(self) -> np.ndarray: ...
    @property
    def delta_peak(self) -> np.ndarray: ...
    @property
    def delta_end(self) -> np.ndarray: ...
    def dissipated(self, reached: np.ndarray) -> np.ndarray: ...


class CohesiveLaw(BondLaw, Protocol):
    """A law whose force depends on the opening now and the largest one seen, and on nothing else."""

    def force(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray: ...
    def stored(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray: ...


@runtime_checkable
class SlidingLaw(BondLaw, Protocol):
    """A law of bonds that resist sliding too, and so turn their particles; k_s in N/m, f_shear in N."""

    @property
    def k_s(self) -> np.ndarray: ...
    @property
    def f_shear(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Grip:
    """One prescribed mean displacement: Σ wᵢ d·uᵢ = drive × machine displacement.

    The reaction acts on the same particles with the same weights, so the gripped patch is free to
    rotate and to deform.

    Parameters
    ----------
    name : str
    index : (k,) int array; particles
    weight : (k,) array, summing to 1
    direction : (2,) array, unit vector d
    drive : float; 1 moves with the machine, 0 is held
    role : Role
    """

    name: str
    index: np.ndarray
    weight: np.ndarray
    direction: np.ndarray
    drive: float
    role: Role

    def mean(self, displacement: np.ndarray) -> float:
        """Weighted mean of d·u over the patch (m), for a displacement field (n, 2)."""
        return float(self.weight @ (displacement[self.index] @ self.direction))


@dataclass(frozen=True)
class Gauge:
    """The clip gauge: CMOD = Σ wᵢ uₓᵢ, weights summing to 0 (+1 on the right flank, −1 on the left).

    Parameters
    ----------
    index : (k,) int array; particles
    weight : (k,) array
    """

    index: np.ndarray
    weight: np.ndarray

    def cmod(self, displacement: np.ndarray) -> float:
        """Crack mouth opening displacement (m) of a displacement field (n, 2)."""
        return float(self.weight @ displacement[self.index, 0])


@dataclass(frozen=True)
class Problem:
    """One fracture test, ready for any engine.

    Parameters
    ----------
    specimen : Specimen
    particles : Particles
    bonds : Bonds
    law : BondLaw with one entry a bond: a CohesiveLaw, or one with sliding or creep
    grips : tuple of Grip
    gauge : Gauge
    kinematics : Kinematics
    cmod_max : float, m; the test ends when the gauge reaches it
    stations : (k,) array, m, increasing; CMOD values at which a full field is wanted
    accuracy : float; quasi-static error asked for, relative, in load and displacement
    cmod_rate : float, m/s; gives simulated curves their time
    clock : Clock or None; the test's own time, for laws that creep
    """

    specimen: Specimen
    particles: Particles
    bonds: Bonds
    law: BondLaw
    grips: tuple[Grip, ...]
    gauge: Gauge
    kinematics: Kinematics
    cmod_max: float
    stations: np.ndarray
    accuracy: float = 0.01
    cmod_rate: float = 1e-5
    clock: Clock | None = None

    def with_law(self, law: BondLaw) -> Problem:
        """The same specimen and test with other bonds' properties."""
        return replace(self, law=law)


@dataclass(frozen=True)
class EnergyBalance:
    """Energies in J at the end of a run; external = machine reaction × machine displacement."""

    external: float
    stored: float
    dissipated: float
    kinetic: float = 0.0
    damping: float = 0.0

    @property
    def error(self) -> float:
        """|W − stored − dissipated − kinetic − damping| / W."""
        rest = self.external - self.stored - self.dissipated - self.kinetic - self.damping
        return abs(rest) / abs(self.external) if self.external else float("nan")


@dataclass(frozen=True)
class Solution:
    """What an engine returns.

    Parameters
    ----------
    curve : LoadCurve with load_line
    cmod : (frames,) array, m; CMOD of the full-field frames, the problem's stations as far as reached
    displacement : (frames, n, 2) array, m; of all particles
    reached : (m,) array, m; largest opening each bond has seen (delta_reached), at the end; any value up
        to delta_peak where it has not softened
    energy : EnergyBalance
    quasi_static_error : float; the engine's own estimate, relative
    steps : int; time steps or increments
    seconds : float; processor time of the solve
    engine : str
    converged : bool
    message : str; one sentence on how the run ended
    """

    curve: LoadCurve
    cmod: np.ndarray
    displacement: np.ndarray
    reached: np.ndarray
    energy: EnergyBalance
    quasi_static_error: float
    steps: int
    seconds: float
    engine: str
    converged: bool
    message: str
