"""Bonds within one step of which only the end is sought: forces, and what a minimiser measures steps by.

What happened before the step, and how long it takes, is known. A *deformation* is what a lattice is asked for: openings
(m,), m, of all bonds, and where they slide the slidings after them, (2m,). Forces come back in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.creeping_softening import BondState, CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening, MixedState
from pipeline.materials.softening import Unloading


class Trial(Protocol):
    """What may be asked for any deformation (k,), m; arrays (k,), k one entry a bond or two.

    `elastic`: stiffness, N/m, of undamaged bonds in this step. `force`: N, tension positive. `secant`: a stiffness,
    N/m, zero or positive, force over deformation unless the bond unloads elastically. `softening`: which bonds are on
    their softening branch, where the tangent is negative. `usage` (m,): share of its strength that an undamaged bond
    has used.
    """

    @property
    def elastic(self) -> np.ndarray: ...
    def force(self, deformation: np.ndarray) -> np.ndarray: ...
    def secant(self, deformation: np.ndarray) -> np.ndarray: ...
    def softening(self, deformation: np.ndarray) -> np.ndarray: ...
    def usage(self, deformation: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class CentralTrial:
    """Bonds that only open; `reached` (m,), m, before the step.

    Few are on their falling branch: up to `limit` (m,), m, a bond that unloads by its secant has the stiffness
    `slope` (m,), N/m, and the law itself is asked only beyond.
    """

    law: CentralSoftening
    reached: np.ndarray
    limit: np.ndarray = field(init=False, repr=False)
    slope: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "limit", np.maximum(self.reached, self.law.delta_peak))
        object.__setattr__(self, "slope", self.law.secant(self.reached))

    @property
    def elastic(self) -> np.ndarray:
        return self.law.k_n

    def force(self, deformation: np.ndarray) -> np.ndarray:
        if self.law.unloading is Unloading.ELASTIC:
            return self.law.force(deformation, self.reached)
        force = deformation * np.where(deformation > 0, self.slope, self.law.k_n)
        beyond = np.flatnonzero(deformation > self.limit)
        force[beyond] = self.law.falling(deformation[beyond], beyond)
        return force

    def secant(self, deformation: np.ndarray) -> np.ndarray:
        at = np.where(deformation > 0, deformation, 1.0)
        force = self.force(at)
        secant = np.where(deformation > 0, force / at, self.law.k_n)
        if self.law.unloading is Unloading.ELASTIC:
            return np.where((deformation > 0) & (deformation < self.reached) & (force > 0), self.law.k_n, secant)
        return secant

    def softening(self, deformation: np.ndarray) -> np.ndarray:
        return (deformation > self.law.delta_peak) & (deformation >= self.reached)

    def usage(self, deformation: np.ndarray) -> np.ndarray:
        return deformation / self.law.delta_peak


@dataclass(frozen=True)
class MixedTrial:
    """Bonds that open and slide; `state` before the step.

    Friction slides within the step (return mapping); the place from which it counts is that before the step.
    """

    law: MixedSoftening
    state: MixedState

    @property
    def elastic(self) -> np.ndarray:
        return np.append(self.law.k_n, self.law.k_s)

    def force(self, deformation: np.ndarray) -> np.ndarray:
        force = self.elastic * deformation
        some, law, after = self._damaged(deformation)
        normal, shear = law.forces(after, *self._at(deformation, some))
        force[some], force[some + self.law.k_n.size] = normal, shear
        return force

    def secant(self, deformation: np.ndarray) -> np.ndarray:
        """K where a bond unloads elastically or sticks; nothing where it rubs."""
        secant = self.elastic
        some, law, after = self._damaged(deformation)
        at, before = self._at(deformation, some), self.state.of(some)
        grows, failed = after.progress > before.progress, after.progress >= law.last
        for k, forces in enumerate(law.forces(after, *at)):
            stiffness, moved = (law.k_n, law.k_s)[k], at[k] != 0
            with np.errstate(over="ignore"):  # of what has hardly moved; limited all the same
                over = np.where(moved, forces / np.where(moved, at[k], 1.0), stiffness)
            over = np.clip(over, 0.0, stiffness)
            if law.unloading is Unloading.ELASTIC:
                over = np.where(grows | failed, over, stiffness)
            secant[some + k * self.law.k_n.size] = over
        rests = failed & (at[0] < 0) & (self.law.friction > 0)
        sticks = rests & (after.plastic[:, 1] == before.plastic[:, 1])
        across = some + self.law.k_n.size
        secant[across] = np.where(rests, np.where(sticks, law.k_s, 0.0), secant[across])
        return secant

    def softening(self, deformation: np.ndarray) -> np.ndarray:
        some, _, after = self._damaged(deformation)
        grows = np.zeros(self.law.k_n.size, bool)
        grows[some] = after.progress > self.state.progress[some]
        return np.append(grows & (deformation[: grows.size] > 0), grows)

    def usage(self, deformation: np.ndarray) -> np.ndarray:
        opening, sliding = np.split(deformation, 2)
        law = self.law
        return np.where(
            np.isfinite(law.f_max),
            np.hypot(law.k_n * np.maximum(opening, 0.0) / law.f_max, law.k_s * sliding / law.f_shear),
            0.0,
        )

    def _damaged(self, deformation: np.ndarray) -> tuple[np.ndarray, MixedSoftening, MixedState]:
        """Numbers (k,) of the bonds that are damaged or would be, few and costly, their law, and their state then."""
        some = np.flatnonzero((self.state.progress > 0) | (self.usage(deformation) > 1))
        law = self.law.of(some)
        return some, law, law.advance(self.state.of(some), *self._at(deformation, some))

    def _at(self, deformation: np.ndarray, bonds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Openings and slidings (k,), m, of some bonds."""
        return deformation[bonds], deformation[bonds + self.law.k_n.size]


class CreepingTrial:
    """Bonds that creep; `state` before a step of `duration` s.

    Below the strength the force is h + K (δ − δ_before), K the tangent of the arms over the step: computed once.
    """

    def __init__(self, law: CreepingSoftening, state: BondState, duration: float) -> None:
        self.law, self.state = law, state
        self.onset = law.onset(state, duration)
        self.origin = law.origin(self.onset)
        self.kept, self.elastic = law.rising(state, duration)

    def force(self, deformation: np.ndarray) -> np.ndarray:
        force = self.kept + self.elastic * (deformation - self.state.opening)
        some = np.flatnonzero(self.state.softened | (deformation >= self.onset))  # few, and costly
        reached = self.law.furthest(self.state, deformation)[some]
        force[some] = self.law.of(some).softened_force(deformation[some], reached, self.onset[some])
        return force

    def secant(self, deformation: np.ndarray) -> np.ndarray:
        """Below the strength the tangent of the arms, for their force does not count from the origin."""
        softened = self.state.softened | (deformation >= self.onset)
        own = deformation - self.origin
        pulled = softened & (own > 0)
        force = np.where(pulled, self.force(deformation), 0.0)
        secant = np.where(pulled, force / np.where(pulled, own, 1.0), self.law.k_n)
        if self.law.unloading is Unloading.ELASTIC:
            secant = np.where(pulled & (deformation < self.state.reached) & (force > 0), self.law.k_n, secant)
        return np.where(softened, secant, self.elastic)

    def softening(self, deformation: np.ndarray) -> np.ndarray:
        begins = ~self.state.softened & (deformation >= self.onset)
        return begins | (self.state.softened & (deformation > self.origin) & (deformation >= self.state.reached))

    def usage(self, deformation: np.ndarray) -> np.ndarray:
        return deformation / self.law.delta_peak
