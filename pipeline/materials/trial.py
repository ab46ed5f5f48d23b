"""Bonds within one step of which only the end is sought: forces, and what a minimiser measures steps by.

What happened before the step, and how long it takes, is known. A *deformation* is what a lattice is asked for: openings
(m,), m, of all bonds, and where they slide the slidings after them, (2m,). Forces come back in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass
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
    their softening branch, where the tangent is negative.
    """

    @property
    def elastic(self) -> np.ndarray: ...
    def force(self, deformation: np.ndarray) -> np.ndarray: ...
    def secant(self, deformation: np.ndarray) -> np.ndarray: ...
    def softening(self, deformation: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class CentralTrial:
    """Bonds that only open; `reached` (m,), m, before the step."""

    law: CentralSoftening
    reached: np.ndarray

    @property
    def elastic(self) -> np.ndarray:
        return self.law.k_n

    def force(self, deformation: np.ndarray) -> np.ndarray:
        return self.law.force(deformation, self.reached)

    def secant(self, deformation: np.ndarray) -> np.ndarray:
        at = np.where(deformation > 0, deformation, 1.0)
        force = self.law.force(at, self.reached)
        secant = np.where(deformation > 0, force / at, self.law.k_n)
        if self.law.unloading is Unloading.ELASTIC:
            return np.where((deformation > 0) & (deformation < self.reached) & (force > 0), self.law.k_n, secant)
        return secant

    def softening(self, deformation: np.ndarray) -> np.ndarray:
        return (deformation > self.law.delta_peak) & (deformation >= self.reached)


@dataclass(frozen=True)
class MixedTrial:
    """Bonds that open and slide; `state` before the step."""

    law: MixedSoftening
    state: MixedState

    @property
    def elastic(self) -> np.ndarray:
        return np.append(self.law.k_n, self.law.k_s)

    def force(self, deformation: np.ndarray) -> np.ndarray:
        opening, sliding = np.split(deformation, 2)
        return np.concatenate(self.law.forces(self.law.advance(self.state, opening, sliding), opening, sliding))

    def secant(self, deformation: np.ndarray) -> np.ndarray:
        some = deformation != 0
        secant = np.where(some, self.force(deformation) / np.where(some, deformation, 1.0), self.elastic)
        return np.clip(secant, 0.0, self.elastic)

    def softening(self, deformation: np.ndarray) -> np.ndarray:
        opening, sliding = np.split(deformation, 2)
        grows = self.law.advance(self.state, opening, sliding).progress > self.state.progress
        return np.append(grows & (opening > 0), grows)


class CreepingTrial:
    """Bonds that creep; `state` before a step of `duration` s.

    Below the strength the force is h + K (δ − δ_before), K the tangent of the arms over the step: computed once.
    """

    def __init__(self, law: CreepingSoftening, state: BondState, duration: float) -> None:
        self.law, self.state = law, state
        self.onset = law.onset(state, duration)
        self.kept, self.elastic = law.rising(state, duration)

    def force(self, deformation: np.ndarray) -> np.ndarray:
        rising = self.kept + self.elastic * (deformation - self.state.opening)
        softened = self.state.softened | (deformation >= self.onset)
        reached = np.maximum(deformation, self.state.reached)
        return np.where(softened, self.law.softened_force(deformation, reached, self.onset), rising)

    def secant(self, deformation: np.ndarray) -> np.ndarray:
        """Below the strength the tangent of the arms, for their force does not count from the origin."""
        softened = self.state.softened | (deformation >= self.onset)
        pulled = softened & (deformation > 0)
        force = np.where(pulled, self.force(deformation), 0.0)
        secant = np.where(pulled, force / np.where(pulled, deformation, 1.0), self.law.k_n)
        if self.law.unloading is Unloading.ELASTIC:
            secant = np.where(pulled & (deformation < self.state.reached) & (force > 0), self.law.k_n, secant)
        return np.where(softened, secant, self.elastic)

    def softening(self, deformation: np.ndarray) -> np.ndarray:
        begins = ~self.state.softened & (deformation >= self.onset)
        return begins | (self.state.softened & (deformation > 0) & (deformation >= self.state.reached))
