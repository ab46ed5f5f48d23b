"""What bonds remember from step to step, whatever their law: forces out of openings, and energies out of both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pipeline.core.errors import UnavailableError
from pipeline.core.problem import BondLaw
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.creeping_softening import BondState, CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening, MixedState
from pipeline.materials.trial import CentralTrial, CreepingTrial, MixedTrial, Trial


class Memory(Protocol):
    """The bonds at one step; arrays (m,), one entry a bond.

    `follow` brings them to openings and slidings, m, within `duration` s of the test; `tension` and `shear` are their
    forces there, N, `stored` and `used` their energies, J, `reached` the largest opening in m, or its like. `trial` is
    the next step of that duration before its end is known; `settled` follows to the deformation that was found for it.
    `fading` is the largest share of its strength that an undamaged bond would lose if it were held for so long.
    """

    @property
    def opening(self) -> np.ndarray: ...
    @property
    def tension(self) -> np.ndarray: ...
    @property
    def shear(self) -> np.ndarray: ...
    @property
    def stored(self) -> np.ndarray: ...
    @property
    def used(self) -> np.ndarray: ...
    @property
    def reached(self) -> np.ndarray: ...
    def follow(self, opening: np.ndarray, sliding: np.ndarray, duration: float) -> Memory: ...
    def trial(self, duration: float) -> Trial: ...
    def settled(self, deformation: np.ndarray, duration: float) -> Memory: ...
    def fading(self, duration: float) -> float: ...


@dataclass(frozen=True)
class CentralMemory:
    """Bonds that only open."""

    law: CentralSoftening
    opening: np.ndarray
    reached: np.ndarray

    @property
    def tension(self) -> np.ndarray:
        return self.law.force(self.opening, self.reached)

    @property
    def shear(self) -> np.ndarray:
        return np.zeros_like(self.opening)

    @property
    def stored(self) -> np.ndarray:
        return self.law.stored(self.opening, self.reached)

    @property
    def used(self) -> np.ndarray:
        return self.law.dissipated(self.reached)

    def follow(self, opening: np.ndarray, sliding: np.ndarray, duration: float) -> CentralMemory:
        return replace(self, opening=opening, reached=np.maximum(opening, self.reached))

    def trial(self, duration: float) -> CentralTrial:
        return CentralTrial(self.law, self.reached)

    def settled(self, deformation: np.ndarray, duration: float) -> CentralMemory:
        return self.follow(deformation, np.zeros_like(deformation), duration)

    def fading(self, duration: float) -> float:
        return 0.0

    @property
    def deformation(self) -> np.ndarray:
        """Openings (m,), m."""
        return self.opening

    def of(self, bonds: np.ndarray) -> CentralMemory:
        """Some of the bonds, (k,) int."""
        return CentralMemory(self.law.of(bonds), self.opening[bonds], self.reached[bonds])

    def among(self, law: CentralSoftening, bonds: np.ndarray, deformation: np.ndarray) -> CentralMemory:
        """These bonds, (k,) int in a larger number with `law`; the others were never opened farther than now."""
        reached = np.maximum(deformation, 0.0)
        reached[bonds] = self.reached
        return CentralMemory(law, deformation, reached)


@dataclass(frozen=True)
class MixedMemory:
    """Bonds that open and slide."""

    law: MixedSoftening
    opening: np.ndarray
    sliding: np.ndarray
    state: MixedState

    @property
    def tension(self) -> np.ndarray:
        return self.law.forces(self.state, self.opening, self.sliding)[0]

    @property
    def shear(self) -> np.ndarray:
        return self.law.forces(self.state, self.opening, self.sliding)[1]

    @property
    def stored(self) -> np.ndarray:
        return self.law.stored(self.state, self.opening, self.sliding)

    @property
    def used(self) -> np.ndarray:
        return self.state.used

    @property
    def reached(self) -> np.ndarray:
        return self.law.reached(self.state)

    def follow(self, opening: np.ndarray, sliding: np.ndarray, duration: float) -> MixedMemory:
        return replace(self, opening=opening, sliding=sliding, state=self.law.advance(self.state, opening, sliding))

    def trial(self, duration: float) -> MixedTrial:
        return MixedTrial(self.law, self.state)

    def settled(self, deformation: np.ndarray, duration: float) -> MixedMemory:
        """Friction is booked by the mean of the shear before and after: steps are long here, and bonds open in them."""
        opening, sliding = np.split(deformation, 2)
        after = self.follow(opening, sliding, duration)
        rubbed = self.state.progress >= self.law.last
        if not self.law.friction or not rubbed.any():
            return after
        slip = after.state.plastic[:, 1] - self.state.plastic[:, 1]
        used = np.where(rubbed, self.used + 0.5 * (self.shear + after.shear) * slip, after.used)
        return replace(after, state=replace(after.state, used=used))

    def fading(self, duration: float) -> float:
        return 0.0

    @property
    def deformation(self) -> np.ndarray:
        """Openings and then slidings (2m,), m."""
        return np.append(self.opening, self.sliding)

    def of(self, bonds: np.ndarray) -> MixedMemory:
        """Some of the bonds, (k,) int."""
        return MixedMemory(self.law.of(bonds), self.opening[bonds], self.sliding[bonds], self.state.of(bonds))

    def among(self, law: MixedSoftening, bonds: np.ndarray, deformation: np.ndarray) -> MixedMemory:
        """These bonds, (k,) int in a larger number with `law`; the others are undamaged."""
        opening, sliding = np.split(deformation, 2)
        return MixedMemory(law, opening, sliding, law.at_rest().changed(bonds, self.state))


@dataclass(frozen=True)
class CreepingMemory:
    """Bonds that creep."""

    law: CreepingSoftening
    state: BondState
    used: np.ndarray

    @property
    def opening(self) -> np.ndarray:
        return self.state.opening

    @property
    def tension(self) -> np.ndarray:
        return self.law.force(self.state, self.opening, 0.0)

    @property
    def shear(self) -> np.ndarray:
        return np.zeros_like(self.used)

    @property
    def stored(self) -> np.ndarray:
        return self.law.stored(self.state)

    @property
    def reached(self) -> np.ndarray:
        return self.law.equivalent(self.state)

    def follow(self, opening: np.ndarray, sliding: np.ndarray, duration: float) -> CreepingMemory:
        after = self.law.advance(self.state, opening, duration)
        return replace(self, state=after, used=self.used + self.law.used(self.state, after, duration))

    def trial(self, duration: float) -> CreepingTrial:
        return CreepingTrial(self.law, self.state, duration)

    def settled(self, deformation: np.ndarray, duration: float) -> CreepingMemory:
        return self.follow(deformation, np.zeros_like(deformation), duration)

    def fading(self, duration: float) -> float:
        kept, _ = self.law.rising(self.state, duration)
        pulled = ~self.state.softened & (self.tension > 0)
        return float(np.max(np.where(pulled, self.tension - kept, 0.0) / self.law.f_max, initial=0.0))


def at_rest(law: BondLaw) -> Memory:
    """Bonds that were never loaded.

    Raises
    ------
    UnavailableError
        for a law that nobody knows how to follow
    """
    zero = np.zeros(law.k_n.size)
    if isinstance(law, CentralSoftening):
        return CentralMemory(law, zero, zero)
    if isinstance(law, MixedSoftening):
        return MixedMemory(law, zero, zero, law.at_rest())
    if isinstance(law, CreepingSoftening):
        return CreepingMemory(law, law.at_rest(), zero)
    raise UnavailableError(f"it is not known what bonds with the law {type(law).__name__} remember")
