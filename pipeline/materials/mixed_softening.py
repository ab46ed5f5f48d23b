"""Bonds that open and slide: damage in mixed mode, friction on what has failed.

Opening δ_n, sliding δ_t, δ_n⁺ = ⟨δ_n⟩. Along a direction a = δ_n⁺/δ_e, b = δ_t/δ_e of the plane of both, damage
begins and ends (linear law of the same area) at the lengths (Camanho and Dávila 2002, NASA/TM-2002-211737)

    δ_e0 = [(K^n a/f_n)² + (K^s b/f_t)²]^(−1/2),    δ_ef = {δ_e0 [K^n a²/(f_n δ_n,max) + K^s b²/(f_t δ_t,max)]}^(−1),

which is a quadratic criterion of the forces and a linear one of the energies. With g(s) of the softening branch and
s = (δ_e − δ_e0)/(δ_ef − δ_e0):

- secant unloading: D = max over time of 1 − g(s) δ_e0/δ_e, F_n = (1 − D) K^n δ_n, F_t = (1 − D) K^s δ_t;
- elastic unloading: F = K (δ − p) with a plastic opening and sliding p. δ_e is the length of δ − p; where it exceeds
  g(s) δ_e0, s grows by (δ_e − g(s) δ_e0)/(δ_ef − δ_e0) and p by what the elastic part then exceeds: along a fixed
  direction the same envelope, and a continuous force where the direction changes.

Closed bonds (δ_n < 0) carry K^n δ_n whatever has happened, and no opening is damaged by it. A failed and closed bond
rubs: F_t = K^s (δ_t − p_t), at most μ K^n |δ_n|. State in, state out.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.core.errors import InputError
from pipeline.materials.cohesive import CentralSoftening, Factor, refuse_brittle, refuse_values
from pipeline.materials.softening import LINEAR, Softening, Unloading, named_unloading


@dataclass(frozen=True)
class MixedState:
    """What m bonds remember.

    Parameters
    ----------
    progress : (m,) array; D with secant unloading, the way s along the branch with elastic
    plastic : (m, 2) array, m; opening and sliding of unloaded bonds; once failed, where there is friction, the stretch
        of its spring and the place from which it counts
    used : (m,) array, J; energy used up by damage and friction
    """

    progress: np.ndarray
    plastic: np.ndarray
    used: np.ndarray

    def of(self, bonds: np.ndarray) -> MixedState:
        """The state of some of the bonds: numbers (k,) or bools (m,)."""
        return MixedState(self.progress[bonds], self.plastic[bonds], self.used[bonds])

    def changed(self, bonds: np.ndarray, state: MixedState) -> MixedState:
        """The state in which some bonds (k,) int are as another state of k has them."""
        parts = [self.progress.copy(), self.plastic.copy(), self.used.copy()]
        for mine, other in zip(parts, (state.progress, state.plastic, state.used), strict=True):
            mine[bonds] = other
        return MixedState(*parts)


@dataclass(frozen=True)
class Mode:
    """Where damage begins and ends along the directions (a, b) that m bonds are deformed in.

    `size` δ_e, `onset` δ_e0, `end` δ_ef in m (m,), `onset_force` in N: length of the elastic force conjugate to δ_e.
    """

    size: np.ndarray
    a: np.ndarray
    b: np.ndarray
    onset: np.ndarray
    end: np.ndarray
    onset_force: np.ndarray


@dataclass(frozen=True)
class MixedSoftening:
    """Softening in opening and sliding; one entry a bond.

    Parameters
    ----------
    k_n, k_s : (m,) arrays, N/m, positive
    f_max, f_shear : (m,) arrays, N, positive; strengths in pure opening and pure sliding; both inf: no damage
    delta_max, delta_shear : (m,) arrays, m; ends of the linear laws of the same area
    softening : Softening
    unloading : Unloading
    friction : float; Coulomb coefficient of failed bonds, 0: none
    """

    k_n: np.ndarray
    k_s: np.ndarray
    f_max: np.ndarray
    f_shear: np.ndarray
    delta_max: np.ndarray
    delta_shear: np.ndarray
    softening: Softening = LINEAR
    unloading: Unloading = Unloading.SECANT
    friction: float = 0.0
    delta_peak: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        names = ("k_n", "k_s", "f_max", "f_shear", "delta_max", "delta_shear")
        rows = np.broadcast_arrays(*(np.atleast_1d(np.asarray(getattr(self, n), float)) for n in names))
        for name, values in zip(names, rows, strict=True):
            object.__setattr__(self, name, values.copy())
        object.__setattr__(self, "unloading", named_unloading(self.unloading))
        refuse_values(self.k_n, self.f_max, self.delta_max)
        _refuse_shear(self)
        object.__setattr__(self, "delta_peak", self.f_max / self.k_n)
        refuse_brittle(self.delta_max, self.delta_peak)
        refuse_brittle_shear(self.k_s, self.f_shear, self.delta_shear)

    @property
    def opening(self) -> CentralSoftening:
        """The law in pure opening."""
        return CentralSoftening(self.k_n, self.f_max, self.delta_max, self.softening, self.unloading)

    @property
    def delta_end(self) -> np.ndarray:
        """Opening (m,), m, from which on a bond that never slid is broken."""
        return self.opening.delta_end

    @property
    def last(self) -> float:
        """`progress` of a failed bond."""
        return 1.0 if self.unloading is Unloading.SECANT else self.softening.end

    def of(self, bonds: np.ndarray) -> MixedSoftening:
        """The law of some of the bonds: numbers (k,) or bools (m,)."""
        names = ("k_n", "k_s", "f_max", "f_shear", "delta_max", "delta_shear")
        return replace(self, **{name: getattr(self, name)[bonds] for name in names})

    def times(self, stiffness: Factor, strength: Factor, opening: Factor) -> MixedSoftening:
        """The law with the stiffnesses, strengths and ends of every bond multiplied, each by a number or (m,)."""
        return replace(
            self,
            k_n=stiffness * self.k_n,
            k_s=stiffness * self.k_s,
            f_max=strength * self.f_max,
            f_shear=strength * self.f_shear,
            delta_max=opening * self.delta_max,
            delta_shear=opening * self.delta_shear,
        )

    def spared(self, bonds: np.ndarray) -> MixedSoftening:
        """The law with some bonds (m,) bool that take no damage."""
        f_max, f_shear = (np.where(bonds, np.inf, strength) for strength in (self.f_max, self.f_shear))
        return replace(self, f_max=f_max, f_shear=f_shear)

    def at_rest(self) -> MixedState:
        """Bonds that were never loaded."""
        zero = np.zeros_like(self.k_n)
        return MixedState(zero, np.zeros((zero.size, 2)), zero)

    def mode(self, opening: np.ndarray, sliding: np.ndarray) -> Mode:
        """Onset and end of damage along the direction of elastic openings (m,) and slidings (m,), m."""
        pulled = np.maximum(opening, 0.0)
        size = np.hypot(pulled, sliding)
        some = size > 0
        a = np.where(some, pulled / np.where(some, size, 1.0), 1.0)
        b = np.where(some, sliding / np.where(some, size, 1.0), 0.0)
        free = np.isfinite(self.f_max)
        f_n, f_t, d_n, d_t = (
            np.where(free, v, 1.0) for v in (self.f_max, self.f_shear, self.delta_max, self.delta_shear)
        )
        onset = 1 / np.hypot(self.k_n * a / f_n, self.k_s * b / f_t)
        end = 1 / (onset * (self.k_n * a**2 / (f_n * d_n) + self.k_s * b**2 / (f_t * d_t)))
        onset = np.where(free, onset, np.inf)
        return Mode(size, a, b, onset, end, (self.k_n * a**2 + self.k_s * b**2) * np.where(free, onset, 0.0))

    def advance(self, state: MixedState, opening: np.ndarray, sliding: np.ndarray) -> MixedState:
        """The state after bonds were brought to openings (m,) and slidings (m,), m.

        Energy is exact along a direction that does not change within the step, that of friction where the bond is
        pressed as much as before.
        """
        step = self._damaged if self.unloading is Unloading.SECANT else self._yielded
        after = step(state, opening, sliding)
        return self._rubbed(state, after, opening, sliding)

    def forces(self, state: MixedState, opening: np.ndarray, sliding: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F_n and F_t (m,), N, tension positive, of bonds whose state has been advanced to these openings."""
        failed = state.progress >= self.last
        if self.unloading is Unloading.SECANT:
            kept = 1 - state.progress
            tension, shear = kept * self.k_n * opening, kept * self.k_s * sliding
        else:
            tension = np.where(failed, 0.0, self.k_n * np.maximum(opening - state.plastic[:, 0], 0.0))
            shear = self.k_s * (sliding - state.plastic[:, 1])
        rubbing = self.k_s * (sliding - state.plastic[:, 1]) * ((opening < 0) & (self.friction > 0))
        return np.where(opening < 0, self.k_n * opening, tension), np.where(failed, rubbing, shear)

    def stored(self, state: MixedState, opening: np.ndarray, sliding: np.ndarray) -> np.ndarray:
        """Recoverable energy (m,), J, at the openings that the state has been advanced to."""
        normal, shear = self.forces(state, opening, sliding)
        if self.unloading is Unloading.ELASTIC:
            return 0.5 * (normal**2 / self.k_n + shear**2 / self.k_s)
        failed = state.progress >= self.last
        return 0.5 * (normal * opening + shear * np.where(failed, shear / self.k_s, sliding))

    def damage(self, state: MixedState) -> np.ndarray:
        """D (m,): 0 elastic, 1 broken; with elastic unloading that of pure opening at the same share of the way."""
        if self.unloading is Unloading.SECANT:
            return state.progress
        return self.opening.damage(self.reached(state))

    def reached(self, state: MixedState) -> np.ndarray:
        """The largest opening (m,), m, that would have done the same in pure opening; 0 before any damage."""
        free = np.isfinite(self.f_max)
        peak, last = np.where(free, self.delta_peak, 1.0), np.where(free, self.delta_max, 2.0)
        way = state.progress
        if self.unloading is Unloading.SECANT:
            way = self.softening.way_of_damage(state.progress, last / peak)
        equal = np.where(state.progress >= self.last, self.delta_end, peak + way * (last - peak))
        return np.where(state.progress > 0, equal, 0.0)

    def dissipated(self, reached: np.ndarray) -> np.ndarray:
        """Energy (m,), J, used up in pure opening to `reached` (m,), m; `state.used` has that of the true path."""
        return self.opening.dissipated(reached)

    def _damaged(self, state: MixedState, opening: np.ndarray, sliding: np.ndarray) -> MixedState:
        """Secant unloading: damage by the largest deformation of its direction."""
        mode = self.mode(opening, sliding)
        beyond = mode.size > mode.onset
        onset, size = np.where(beyond, mode.onset, 1.0), np.where(beyond, mode.size, 1.0)
        end = np.where(beyond, mode.end, 2.0)
        way = (size - onset) / (end - onset)
        damage = np.where(beyond, 1 - self.softening.left(way) * onset / size, 0.0)
        grows = damage > state.progress
        before = self.softening.way_of_damage(state.progress, end / onset)
        spent = self._secant_work(way, onset, end) - self._secant_work(before, onset, end)
        used = np.where(grows, state.used + mode.onset_force * spent, state.used)
        return replace(state, progress=np.where(grows, damage, state.progress), used=used)

    def _secant_work(self, way: np.ndarray, onset: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Energy used up along the branch over the force at its onset (m,), m: area less ½ g δ_e."""
        at = np.minimum(way, self.softening.end)
        size = onset + at * (end - onset)
        return onset / 2 + (end - onset) * self.softening.area(at) - 0.5 * self.softening.left(at) * size

    def _yielded(self, state: MixedState, opening: np.ndarray, sliding: np.ndarray) -> MixedState:
        """Elastic unloading: what exceeds the strength left becomes plastic, along the elastic direction."""
        mode = self.mode(opening - state.plastic[:, 0], sliding - state.plastic[:, 1])
        left = self.softening.left(state.progress)
        onset = np.where(np.isfinite(mode.onset), mode.onset, 1.0)
        beyond = np.isfinite(mode.onset) & (mode.size > left * onset) & (state.progress < self.last)
        way = np.where(beyond, mode.size - left * onset, 0.0) / np.where(beyond, mode.end - onset, 1.0)
        after = np.minimum(state.progress + way, self.last)
        slip = np.where(beyond, mode.size - self.softening.left(after) * onset, 0.0)
        work = 0.5 * onset * (left**2 - self.softening.left(after) ** 2)
        work += (mode.end - onset) * (self.softening.area(after) - self.softening.area(state.progress))
        return MixedState(
            progress=np.where(beyond, after, state.progress),
            plastic=state.plastic + slip[:, None] * np.column_stack([mode.a, mode.b]),
            used=state.used + np.where(beyond, mode.onset_force * work, 0.0),
        )

    def _rubbed(self, before: MixedState, after: MixedState, opening: np.ndarray, sliding: np.ndarray) -> MixedState:
        """Failed bonds: friction counts from where they failed, slides at its limit, and is forgotten when open.

        What its spring held when the bond was last closed is lost when it opens, and nothing while it stays open.
        """
        failed = after.progress >= self.last
        if not self.friction or not np.any(failed):
            return after
        old = before.progress >= self.last
        place = np.where(failed & ~old, sliding, after.plastic[:, 1])
        stretch = np.where(old, before.plastic[:, 0], 0.0)
        limit = self.friction * self.k_n * np.maximum(-opening, 0.0)
        shear = self.k_s * (sliding - place)
        slips = failed & (np.abs(shear) > limit)
        to = np.where(slips, sliding - np.copysign(limit, shear) / self.k_s, place)
        lost = np.where(limit > 0, limit * np.abs(to - place), 0.5 * self.k_s * stretch**2)
        kept = np.where(failed, sliding - to, after.plastic[:, 0])
        return replace(after, plastic=np.column_stack([kept, to]), used=after.used + np.where(failed, lost, 0.0))


def _refuse_shear(law: MixedSoftening) -> None:
    """The rules of `refuse_values` for sliding."""
    free = np.isfinite(law.f_max)
    rules = (
        ("k_s", "N/m", law.k_s, np.isfinite(law.k_s) & (law.k_s > 0), "finite and positive"),
        ("f_shear", "N", law.f_shear, ~free | (np.isfinite(law.f_shear) & (law.f_shear > 0)), "finite and positive"),
        (
            "f_shear",
            "N",
            law.f_shear,
            free | ~np.isfinite(law.f_shear),
            "inf where f_max is: a bond takes damage in both modes or in none",
        ),
        (
            "delta_shear",
            "m",
            law.delta_shear,
            ~free | (np.isfinite(law.delta_shear) & (law.delta_shear > 0)),
            "finite and positive",
        ),
    )
    for name, unit, values, good, rule in rules:
        if not np.all(good):
            raise InputError(f"{name} = {values[~good][0]:g} {unit} must be {rule}")
    if not (np.isfinite(law.friction) and law.friction >= 0):
        raise InputError(f"friction = {law.friction:g} must be finite and zero or positive")


def refuse_brittle_shear(k_s: np.ndarray, f_shear: np.ndarray, delta_shear: np.ndarray) -> None:
    """Refuse a softening branch in sliding that would run backwards."""
    peak = f_shear / k_s
    bad = np.isfinite(peak) & (delta_shear <= peak)
    if np.any(bad):
        raise InputError(
            f"delta_shear = {delta_shear[bad][0]:g} m must be larger than f_shear/k_s = {peak[bad][0]:g} m: raise "
            "delta_shear or lower f_shear"
        )
