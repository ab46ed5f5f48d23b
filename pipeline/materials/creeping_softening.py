"""A bond that creeps until its strength is reached, and softens from there.

Hill et al. 2017, "Discrete Element Modeling": the viscoelastic bond differs from the elastic one before its peak
only. Below f_max the force is that of the Maxwell arms, whatever the opening. Where it first reaches f_max, at
an opening δ*, softening begins: a straight line from (δ*, f_max) to (δ_max, 0), creep stops, unloading goes to the
origin along the secant. A bond with δ* ≥ δ_max breaks at once. Undamaged bonds creep in compression too; damaged
ones are elastic there, with K(0), and so carry no tension while they are closed, wherever δ* lay.

Within one step of physical time Δt the force is a function of the opening at its end alone,

    f = h(Δt) + K_Δt (δ − δ_before)        below δ* = δ_before + (f_max − h(Δt))/K_Δt,

with h the force that the arms would keep at constant opening and K_Δt their tangent: a linear softening law with
another stiffness and another origin, which an engine may minimise as it does without creep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.materials.relaxation import Arms, crept, history_force, relax, stored, tangent, total


@dataclass(frozen=True)
class BondState:
    """What m bonds remember between steps.

    Parameters
    ----------
    opening : (m,) array, m; at the end of the last step
    arms : (m, k) array, N; forces of the Maxwell arms, 0 once softening has begun
    onset : (m,) array, m; δ*, the opening at which softening began; inf: it has not
    reached : (m,) array, m; largest opening since then, 0 before
    """

    opening: np.ndarray
    arms: np.ndarray
    onset: np.ndarray
    reached: np.ndarray

    @property
    def softened(self) -> np.ndarray:
        """Which bonds have reached their strength; (m,) bool."""
        return np.isfinite(self.onset)


@dataclass(frozen=True)
class CreepingSoftening:
    """Linear softening behind a creeping rise; one entry a bond.

    Parameters
    ----------
    rise : Arms; K(t), in N/m
    f_max : (m,) array, N, positive; inf: the bond takes no damage
    delta_max : (m,) array, m, positive; ignored where f_max is inf
    """

    rise: Arms
    f_max: np.ndarray
    delta_max: np.ndarray

    def __post_init__(self) -> None:
        f_max, delta_max = np.asarray(self.f_max, float), np.asarray(self.delta_max, float)
        _refuse("f_max", f_max, f_max > 0, self.rise)
        _refuse("delta_max", delta_max, (delta_max > 0) | ~np.isfinite(f_max), self.rise)

    def at_rest(self) -> BondState:
        """Bonds that were never loaded."""
        zero = np.zeros_like(self.rise.left)
        return BondState(zero, self.rise.relaxed(), np.full_like(zero, np.inf), zero)

    def onset(self, state: BondState, duration: float) -> np.ndarray:
        """δ* (m,), m: where softening has begun, or would begin in a step of `duration` s."""
        kept = history_force(self.rise, state.arms, duration) + self.rise.left * state.opening
        ahead = state.opening + (self.f_max - kept) / tangent(self.rise, duration)
        return np.where(state.softened, state.onset, ahead)

    def force(self, state: BondState, opening: np.ndarray, duration: float) -> np.ndarray:
        """Force (m,), N, tension positive, at the end of a step of `duration` s that ends at `opening` (m,), m."""
        onset = self.onset(state, duration)
        softening = state.softened | (opening >= onset)
        arms = relax(self.rise, state.arms, opening - state.opening, duration)
        reached = np.maximum(opening, state.reached)
        return np.where(softening, self._softened(opening, reached, onset), total(self.rise, arms, opening))

    def advance(self, state: BondState, opening: np.ndarray, duration: float) -> BondState:
        """The state after a step of `duration` s that ends at `opening` (m,), m."""
        onset = self.onset(state, duration)
        softening = state.softened | (opening >= onset)
        arms = relax(self.rise, state.arms, opening - state.opening, duration)
        return BondState(
            opening=np.array(opening, float),
            arms=np.where(softening[:, None], 0.0, arms),
            onset=np.where(softening, onset, np.inf),
            reached=np.where(softening, np.maximum(opening, state.reached), 0.0),
        )

    def envelope(self, reached: np.ndarray, onset: np.ndarray) -> np.ndarray:
        """Force (m,), N, of softened bonds at their largest opening; 0 for those with δ* ≥ δ_max."""
        some = np.isfinite(onset) & np.isfinite(self.delta_max)
        way = np.subtract(self.delta_max, onset, out=np.zeros_like(onset), where=some)
        rest = np.subtract(self.delta_max, reached, out=np.zeros_like(onset), where=some)
        left = np.divide(rest, way, out=np.zeros_like(way), where=way > 0)
        return np.where(np.isfinite(self.f_max), self.f_max, 0.0) * np.clip(left, 0.0, 1.0)

    def stored(self, state: BondState) -> np.ndarray:
        """Recoverable energy (m,), J: of the arms' springs, or half of force times opening once softened."""
        force = self._softened(state.opening, state.reached, state.onset)
        return np.where(state.softened, 0.5 * state.opening * force, stored(self.rise, state.arms, state.opening))

    def crept(self, state: BondState, opening: np.ndarray, duration: float) -> np.ndarray:
        """Energy (m,), J, that the dashpots of bonds not softened use up in a step."""
        used = crept(self.rise, state.arms, opening - state.opening, duration)
        return np.where(state.softened | (opening >= self.onset(state, duration)), 0.0, used)

    def _softened(self, opening: np.ndarray, reached: np.ndarray, onset: np.ndarray) -> np.ndarray:
        """Force (m,), N, of softened bonds: secant in tension, K(0) in compression."""
        pulled = opening > 0
        secant = np.divide(
            self.envelope(reached, onset), reached, out=np.zeros_like(self.delta_max), where=pulled & (reached > 0)
        )
        return opening * np.where(pulled, secant, self.rise.instantaneous)


def _refuse(name: str, values: np.ndarray, good: np.ndarray, rise: Arms) -> None:
    if values.shape != rise.left.shape:
        raise InputError(f"{name} of {values.size} bonds for the arms of {rise.left.size}: one each is needed")
    if not good.all():
        raise InputError(f"{name} = {values[~good][0]:g} of a creeping bond must be positive")
