"""A bond that creeps until its strength is reached, and softens from there.

Hill et al. 2017, "Discrete Element Modeling": the viscoelastic bond differs from the elastic one before its peak
only. Below f_max the force is that of the Maxwell arms, whatever the opening. Where it first reaches f_max, at
an opening δ*, softening begins: from (δ*, f_max), a straight line to (δ_max, 0) or another shape g(s) along
s = (δ − δ*)/(δ_max − δ*); creep stops, unloading goes to the origin along the secant, or elastically with K(0) down to
a plastic opening. A bond with δ* ≥ δ_max breaks at once. Undamaged bonds creep in compression too; damaged
ones are elastic there, with K(0). A bond that crept under compression has become shorter: where its δ* lies below
f_max/K(0), its origin p = δ* − f_max/K(0) is where K(0) leads to (δ*, f_max), p = 0 otherwise. From there openings
count once it softens, so that its force is continuous and no secant is stiffer than K(0).

Within one step of physical time Δt the force is a function of the opening at its end alone,

    f = h(Δt) + K_Δt (δ − δ_before)        below δ* = δ_before + (f_max − h(Δt))/K_Δt,

with h the force that the arms would keep at constant opening and K_Δt their tangent: a linear softening law with
another stiffness and another origin, which an engine may minimise as it does without creep.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.problem import Problem
from pipeline.materials.cohesive import CentralSoftening, Factor, refuse_values
from pipeline.materials.relaxation import Arms, crept, history_force, relax, stored, tangent, total
from pipeline.materials.softening import LINEAR, Softening, Unloading, named_unloading


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
    """Softening behind a creeping rise; one entry a bond.

    Parameters
    ----------
    rise : Arms; K(t), in N/m
    f_max : (m,) array, N, positive; inf: the bond takes no damage
    delta_max : (m,) array, m, positive; ignored where f_max is inf. Where the *linear* branch of the same area ends
    softening : Softening
    unloading : Unloading
    """

    rise: Arms
    f_max: np.ndarray
    delta_max: np.ndarray
    softening: Softening = LINEAR
    unloading: Unloading = Unloading.SECANT

    def __post_init__(self) -> None:
        object.__setattr__(self, "unloading", named_unloading(self.unloading))
        for name in ("f_max", "delta_max"):
            values = np.array(getattr(self, name), float)
            if values.shape != self.rise.left.shape:
                raise InputError(
                    f"{name} of {values.size} bonds for the arms of {self.rise.left.size}: one each is needed"
                )
            object.__setattr__(self, name, values)
        _refuse_arms(self.rise)
        refuse_values(self.k_n, self.f_max, self.delta_max)

    def of(self, bonds: np.ndarray) -> CreepingSoftening:
        """The law of some of the bonds: numbers (k,) or bools (m,)."""
        rise = Arms(self.rise.stiffness[bonds], self.rise.time[bonds], self.rise.left[bonds])
        return replace(self, rise=rise, f_max=self.f_max[bonds], delta_max=self.delta_max[bonds])

    def times(self, stiffness: Factor, strength: Factor, opening: Factor) -> CreepingSoftening:
        """The law with stiffness, strength and last opening of every bond multiplied, each by a number or (m,)."""
        factor = np.broadcast_to(stiffness, self.rise.left.shape)
        rise = Arms(factor[:, None] * self.rise.stiffness, self.rise.time, factor * self.rise.left)
        return replace(self, rise=rise, f_max=strength * self.f_max, delta_max=opening * self.delta_max)

    def spared(self, bonds: np.ndarray) -> CreepingSoftening:
        """The law with some bonds (m,) bool that take no damage."""
        return replace(self, f_max=np.where(bonds, np.inf, self.f_max))

    def at_rest(self) -> BondState:
        """Bonds that were never loaded."""
        zero = np.zeros_like(self.rise.left)
        return BondState(zero, self.rise.relaxed(), np.full_like(zero, np.inf), zero)

    def onset(self, state: BondState, duration: float) -> np.ndarray:
        """δ* (m,), m: where softening has begun, or would begin in a step of `duration` s."""
        kept, stiffness = self.rising(state, duration)
        return np.where(state.softened, state.onset, state.opening + (self.f_max - kept) / stiffness)

    def rising(self, state: BondState, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Force (m,), N, kept at constant opening for `duration` s, and stiffness (m,), N/m, of what opens meanwhile.

        They hold for bonds that have not softened.
        """
        kept = history_force(self.rise, state.arms, duration) + self.rise.left * state.opening
        return kept, tangent(self.rise, duration)

    def force(self, state: BondState, opening: np.ndarray, duration: float) -> np.ndarray:
        """Force (m,), N, tension positive, at the end of a step of `duration` s that ends at `opening` (m,), m."""
        onset = self.onset(state, duration)
        softening = state.softened | (opening >= onset)
        arms = relax(self.rise, state.arms, opening - state.opening, duration)
        softened = self.softened_force(opening, self.furthest(state, opening), onset)
        return np.where(softening, softened, total(self.rise, arms, opening))

    def advance(self, state: BondState, opening: np.ndarray, duration: float) -> BondState:
        """The state after a step of `duration` s that ends at `opening` (m,), m."""
        onset = self.onset(state, duration)
        softening = state.softened | (opening >= onset)
        arms = relax(self.rise, state.arms, opening - state.opening, duration)
        return BondState(
            opening=np.array(opening, float),
            arms=np.where(softening[:, None], 0.0, arms),
            onset=np.where(softening, onset, np.inf),
            reached=np.where(softening, self.furthest(state, opening), 0.0),
        )

    def furthest(self, state: BondState, opening: np.ndarray) -> np.ndarray:
        """Largest opening (m,), m, since softening began, of bonds that have softened by `opening` (m,), m."""
        return np.where(state.softened, np.maximum(opening, state.reached), opening)

    def origin(self, onset: np.ndarray) -> np.ndarray:
        """p (m,), m, zero or negative: from where openings of softened bonds count."""
        some = np.isfinite(onset) & np.isfinite(self.f_max)
        return np.minimum(np.subtract(onset, self.delta_peak, out=np.zeros_like(self.delta_max), where=some), 0.0)

    @property
    def k_n(self) -> np.ndarray:
        """K(0) (m,), N/m."""
        return self.rise.instantaneous

    @cached_property
    def delta_peak(self) -> np.ndarray:
        """f_max/K(0) (m,), m: where softening would begin without any creep."""
        return self.f_max / self.rise.instantaneous

    @property
    def without_creep(self) -> CentralSoftening:
        """The law of steps that take no time."""
        return CentralSoftening(self.k_n, self.f_max, self.delta_max, self.softening, self.unloading)

    @property
    def delta_end(self) -> np.ndarray:
        """Opening (m,), m, from which on a bond that never crept is broken; inf where it takes no damage."""
        return self.without_creep.delta_end

    def dissipated(self, reached: np.ndarray) -> np.ndarray:
        """Energy (m,), J, used up by bonds that never crept; `used` has that of the true path."""
        return self.without_creep.dissipated(reached)

    def way(self, reached: np.ndarray, onset: np.ndarray) -> np.ndarray:
        """s (m,) of softened bonds at their largest opening; the end where δ* ≥ δ_max, 0 for undamaged ones."""
        some = np.isfinite(onset) & np.isfinite(self.delta_max)
        length = np.subtract(self.delta_max, onset, out=np.ones_like(onset), where=some)
        gone = np.subtract(reached, onset, out=np.zeros_like(onset), where=some)
        way = np.divide(gone, length, out=np.full_like(onset, self.softening.end), where=length > 0)
        return np.where(some, np.maximum(way, 0.0), 0.0)

    def envelope(self, reached: np.ndarray, onset: np.ndarray) -> np.ndarray:
        """Force (m,), N, of softened bonds at their largest opening; 0 for those with δ* ≥ δ_max."""
        left = self.softening.left(self.way(reached, onset))
        return np.where(np.isfinite(self.f_max) & np.isfinite(onset), self.f_max, 0.0) * left

    def broken(self, state: BondState) -> np.ndarray:
        """Which bonds carry nothing any more; (m,) bool."""
        return state.softened & (self.way(state.reached, state.onset) >= self.softening.end)

    def equivalent(self, state: BondState) -> np.ndarray:
        """The largest opening (m,), m, at which a bond that never crept would be as far along its branch; 0 before."""
        some = state.softened & np.isfinite(self.f_max)
        peak, last = np.where(some, self.delta_peak, 0.0), np.where(some, self.delta_max, 0.0)
        way = np.minimum(self.way(state.reached, state.onset), self.softening.end)
        return np.where(some, np.where(self.broken(state), self.delta_end, peak + way * (last - peak)), 0.0)

    def stored(self, state: BondState) -> np.ndarray:
        """Recoverable energy (m,), J: of the arms' springs; once softened ½ f (δ − p), or f²/(2 K(0)) if elastic."""
        force = self.softened_force(state.opening, state.reached, state.onset)
        half = force / self.k_n if self.unloading is Unloading.ELASTIC else state.opening - self.origin(state.onset)
        return np.where(state.softened, 0.5 * half * force, stored(self.rise, state.arms, state.opening))

    def used(self, before: BondState, after: BondState, duration: float) -> np.ndarray:
        """Energy (m,), J, that bonds use up from one state to the next: work less what is stored.

        Of dashpots and of softening exactly for openings that grow linearly in time; where softening begins within
        the step, the work up to there is that of a straight line. What a bond gives back by unloading to the origin
        instead of along K(0) is counted as negative there: δ* is larger than f_max/K(0) by the creep.
        """
        creep = self.crept(before, after.opening, duration)
        further = self._softening_work(after) - np.where(before.softened, self._softening_work(before), 0.0)
        force = total(self.rise, before.arms, before.opening)
        onset = np.where(after.softened, after.onset, 0.0)
        strength = np.where(np.isfinite(self.f_max), self.f_max, 0.0)
        rise = stored(self.rise, before.arms, before.opening) + 0.5 * (force + strength) * (onset - before.opening)
        starts = after.softened & ~before.softened
        return np.where(after.softened, further + np.where(starts, rise, 0.0), creep)

    def crept(self, state: BondState, opening: np.ndarray, duration: float) -> np.ndarray:
        """Energy (m,), J, that the dashpots of bonds not softened use up in a step."""
        used = crept(self.rise, state.arms, opening - state.opening, duration)
        return np.where(state.softened | (opening >= self.onset(state, duration)), 0.0, used)

    def softened_force(self, opening: np.ndarray, reached: np.ndarray, onset: np.ndarray) -> np.ndarray:
        """Force (m,), N, of softened bonds: secant or elastic in tension, K(0) in compression."""
        origin = self.origin(onset)
        own, top = opening - origin, reached - origin
        pulled = own > 0
        envelope = self.envelope(reached, onset)
        if self.unloading is Unloading.ELASTIC:
            tension = np.maximum(envelope - self.k_n * (top - own), 0.0)
        else:
            share = np.divide(own, top, out=np.zeros_like(self.delta_max), where=pulled & (top > 0))
            tension = share * envelope
        return np.where(pulled, tension, self.k_n * own)

    def _softening_work(self, state: BondState) -> np.ndarray:
        """Area of the branch from δ* to the largest opening, less what is stored there (m,), J; 0 if not softened."""
        some = state.softened & np.isfinite(self.f_max)
        onset, last = np.where(some, state.onset, 0.0), np.where(some, self.delta_max, 0.0)
        way = np.maximum(last - onset, 0.0)
        area = np.where(some, self.f_max, 0.0) * way * self.softening.area(self.way(state.reached, state.onset))
        envelope = self.envelope(state.reached, state.onset)
        secant = state.reached - self.origin(state.onset)
        top = envelope / self.k_n if self.unloading is Unloading.ELASTIC else secant
        return np.where(some, area - 0.5 * envelope * top, 0.0)


def refuse_timeless(problem: Problem) -> None:
    """Refuse bonds that creep without the time of the test, and a clock that nothing asks.

    Raises
    ------
    InputError
    """
    creeps = isinstance(problem.law, CreepingSoftening)
    if creeps and problem.clock is None:
        raise InputError("bonds that creep need the time of the test: give the problem a clock, t(CMOD)")
    if problem.clock is not None and not creeps:
        raise InputError("the problem has a clock, t(CMOD), but no bond creeps: leave it out")


def _refuse_arms(rise: Arms) -> None:
    """Refuse arms that are no springs and dashpots; one of no stiffness is none, whatever its time."""
    some = rise.stiffness != 0
    rules = (
        ("stiffness", "N/m", rise.stiffness, np.isfinite(rise.stiffness) & (rise.stiffness >= 0), "zero or positive"),
        ("time", "s", rise.time, ~some | (np.isfinite(rise.time) & (rise.time > 0)), "positive"),
        ("left", "N/m", rise.left, np.isfinite(rise.left) & (rise.left >= 0), "zero or positive"),
    )
    for name, unit, values, good, rule in rules:
        if not np.all(good):
            raise InputError(
                f"{name} = {values[~good][0]:g} {unit} of the arms of a creeping bond must be finite and {rule}"
            )
