"""One bond by its definition, sharing no code with the laws: the rows that both languages must give.

What is used up is integrated from its definition by quadrature; creep is solved by the modes of the differential
equations of the Burgers elements (a Maxwell and a Kelvin element), not as relaxing arms. Exact where every step goes
along one direction in the plane of opening and sliding, from a state that is elastic in that direction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq


@dataclass(frozen=True)
class Branch:
    """Share of the strength left along the way, its slope, where it ends and where it kinks."""

    left: Callable[[float], float]
    slope: Callable[[float], float]
    end: float
    kinks: tuple[float, ...] = ()

    def integral(self, of: Callable[[float], float], start: float, stop: float) -> float:
        """An integral along the way."""
        corners = [start, *(k for k in self.kinks if start < k < stop), stop]
        parts = (quad(of, a, b, epsabs=1e-14, epsrel=1e-13)[0] for a, b in pairwise(corners))
        return float(sum(parts))


def linear() -> Branch:
    return Branch(lambda s: 1 - s, lambda _: -1.0, 1.0)


def exponential() -> Branch:
    """e^(−αs), shifted to end at s = 4, α from the area of one half."""
    alpha = brentq(lambda a: 1 / a - 4 / np.expm1(4 * a) - 0.5, 1, 3, xtol=1e-15)
    last = np.exp(-4 * alpha)
    return Branch(
        lambda s: (np.exp(-alpha * s) - last) / (1 - last), lambda s: -alpha * np.exp(-alpha * s) / (1 - last), 4
    )


def petersson(tail: float) -> Branch:
    """Straight to a third of the strength, straight to the end; tail 1: w 0.8 and 3.6 G_f/f_t; area of one half."""
    kink = (1 - tail) * 2 / 3 + tail * 0.4
    end = 3 - 3 * kink  # (1 + 1/3)/2 kink + (1/3)/2 (end − kink) = 1/2
    ways, shares = [0, kink, end], [1, 1 / 3, 0]
    steep, flat = -2 / 3 / kink, -1 / 3 / (end - kink)
    return Branch(lambda s: float(np.interp(s, ways, shares)), lambda s: steep if s < kink else flat, end, (kink,))


@dataclass(frozen=True)
class Bond:
    """Constants of one bond; k_s = 0: it does not slide."""

    k_n: float
    f_n: float
    d_n: float
    branch: Branch
    elastic: bool = False
    k_s: float = 0.0
    f_t: float = 1.0
    d_t: float = 1.0
    friction: float = 0.0

    def ray(self, opening: float, sliding: float) -> tuple[float, float, float, float, float, float]:
        """δ_e, a, b, δ_e0, δ_ef of a direction (physics: Camanho and Dávila), and the stiffness along it."""
        pulled = max(opening, 0.0)
        size = float(np.sqrt(pulled**2 + sliding**2))
        a, b = (pulled / size, sliding / size) if size else (1.0, 0.0)
        onset = ((self.k_n * a / self.f_n) ** 2 + (self.k_s * b / self.f_t) ** 2) ** -0.5
        end = 1 / (onset * (self.k_n * a**2 / (self.f_n * self.d_n) + self.k_s * b**2 / (self.f_t * self.d_t)))
        return size, a, b, onset, end, self.k_n * a**2 + self.k_s * b**2

    def way_of(self, damage: float, onset: float, end: float) -> float:
        """The way s along a ray on which D = 1 − g(s) δ_e0/(δ_e0 + s (δ_ef − δ_e0))."""
        if damage <= 0 or damage >= 1:
            return 0.0 if damage <= 0 else self.branch.end
        return brentq(lambda s: self.harm(s, onset, end) - damage, 0, self.branch.end, xtol=1e-16, rtol=1e-15)

    def harm(self, way: float, onset: float, end: float) -> float:
        if way >= self.branch.end:
            return 1.0
        return 1 - self.branch.left(way) * onset / (onset + way * (end - onset)) if way > 0 else 0.0

    def released(self, start: float, stop: float, onset: float, end: float, stiffness: float) -> float:
        """∫ Y dD along a ray, Y = ½ K δ_e² being what the damaged bond gives back."""

        def rate(s: float) -> float:
            size = onset + s * (end - onset)
            fall = self.branch.left(s) * (end - onset) / size - self.branch.slope(s)  # −d(g/δ_e)/ds × δ_e
            return 0.5 * stiffness * size * onset * fall

        return self.branch.integral(rate, start, stop)

    def spent(self, start: float, stop: float, onset: float, end: float, stiffness: float) -> float:
        """∫ F dp along a ray, p the plastic part of the deformation."""

        def rate(s: float) -> float:
            return stiffness * onset * self.branch.left(s) * (end - onset - onset * self.branch.slope(s))

        return self.branch.integral(rate, start, stop)


def follow(bond: Bond, path: np.ndarray) -> np.ndarray:
    """Rows (steps, 7): forces along and across, stored, used up, delta_reached, damage, progress; no creep."""
    return np.array(list((_yielding if bond.elastic else _damaging)(bond, path)))


def _damaging(bond: Bond, path: np.ndarray) -> Iterator[list[float]]:
    """Secant unloading: F = (1 − D) K δ, compression as if nothing had happened."""
    damage, used, spring = 0.0, 0.0, None
    for opening, sliding, _ in path:
        size, _, _, onset, end, stiffness = bond.ray(opening, sliding)
        way = min(max((size - onset) / (end - onset), 0.0), bond.branch.end)
        if (grown := bond.harm(way, onset, end)) > damage:
            used += bond.released(bond.way_of(damage, onset, end), way, onset, end, stiffness)
            damage = grown
        shear = (1 - damage) * bond.k_s * sliding
        normal = bond.k_n * opening * (1.0 if opening < 0 else 1 - damage)
        stored = 0.5 * (normal * opening + shear * sliding)
        if damage == 1.0 and bond.friction:
            shear, spring, used = _rub(bond, opening, sliding, spring, used)
            stored = 0.5 * normal * opening + (0.5 * shear**2 / bond.k_s if shear else 0.0)
        yield [normal, shear, stored, used, _pure_opening(bond, damage), damage, damage if bond.k_s else 0.0]


def _yielding(bond: Bond, path: np.ndarray) -> Iterator[list[float]]:
    """Elastic unloading: F = K (δ − p); the way grows with the plastic deformation, along the elastic direction."""
    way, used, spring = 0.0, 0.0, None
    plastic = np.zeros(2)
    last = bond.branch.end
    for opening, sliding, _ in path:
        size, a, b, onset, end, stiffness = bond.ray(opening - plastic[0], sliding - plastic[1])
        left = bond.branch.left(way)
        if way < last and size > left * onset:
            grown = min(way + (size - left * onset) / (end - onset), last)
            used += bond.spent(way, grown, onset, end, stiffness)
            plastic = plastic + (size - bond.branch.left(grown) * onset) * np.array([a, b])
            way = grown
        normal = bond.k_n * (opening if opening < 0 else max(opening - plastic[0], 0.0) if way < last else 0.0)
        shear = bond.k_s * (sliding - plastic[1]) if way < last else 0.0
        if way >= last and bond.friction:
            shear, spring, used = _rub(bond, opening, sliding, spring, used)
        stored = 0.5 * normal**2 / bond.k_n + (0.5 * shear**2 / bond.k_s if bond.k_s else 0.0)
        peak = bond.f_n / bond.k_n
        seen = peak + way * (bond.d_n - peak) if way > 0 else 0.0
        harm = bond.harm(way, peak, bond.d_n)
        yield [normal, shear, stored, used, seen, harm, way if bond.k_s else 0.0]


def _rub(
    bond: Bond, opening: float, sliding: float, spring: tuple[float, float] | None, used: float
) -> tuple[float, tuple[float, float], float]:
    """A spring that slides at μ times the compression, from where the bond failed; opening lets it go.

    `spring`: how far it was stretched by the step before, and from where.
    """
    stretch, place = spring or (0.0, sliding)
    limit = bond.friction * bond.k_n * max(-opening, 0.0)
    if limit == 0:
        return 0.0, (0.0, sliding), used + 0.5 * bond.k_s * stretch**2
    pull = bond.k_s * (sliding - place)
    slid = float(np.sign(pull)) * max(abs(pull) - limit, 0.0) / bond.k_s
    stretch = sliding - place - slid
    return bond.k_s * stretch, (stretch, place + slid), used + limit * abs(slid)


def _pure_opening(bond: Bond, damage: float) -> float:
    """The opening that alone would have done the same damage."""
    peak = bond.f_n / bond.k_n
    return peak + bond.way_of(damage, peak, bond.d_n) * (bond.d_n - peak) if damage > 0 else 0.0


@dataclass(frozen=True)
class Creeping:
    """A Burgers bond, compliances per N: spring, dashpot, Kelvin element; softening as of `bond`, whose k_n is 1/d1."""

    bond: Bond
    d1: float
    flow: float
    d2: float
    tau: float

    def state_at(self, state: np.ndarray, step: float, passed: np.ndarray, duration: float) -> np.ndarray:
        """Force f, N, and Kelvin elongation y, m, (2, k) `passed` s (k,) into a step of `step` m in `duration` s."""
        # D1 f' = v − φ f − y', τ y' = D2 f − y, with the rate v as a third variable
        kelvin = np.array([self.d2, -1.0, 0.0]) / self.tau
        matrix = np.array([(np.array([-self.flow, 0.0, 1.0]) - kelvin) / self.d1, kelvin, np.zeros(3)])
        rates, modes = np.linalg.eig(matrix)
        share = np.linalg.solve(modes, [*state, step / duration])
        return (modes @ (share[:, None] * np.exp(np.outer(rates, passed))))[:2]

    def after(self, state: np.ndarray, step: float, duration: float) -> np.ndarray:
        """Force and Kelvin elongation (2,) behind a step."""
        if not duration:
            return np.array([state[0] + step / self.d1, state[1]])
        return self.state_at(state, step, np.array([duration]), duration)[:, 0]

    def stored(self, state: np.ndarray) -> float:
        """Of the two springs."""
        return 0.5 * self.d1 * float(state[0]) ** 2 + 0.5 * float(state[1]) ** 2 / self.d2

    def work(self, state: np.ndarray, step: float, duration: float) -> float:
        """∫ f dδ of a step, by Gauss over pieces that begin ever nearer to its start."""
        if not duration or not step:
            return step * (float(state[0]) + 0.5 * step / self.d1)
        node, weight = np.polynomial.legendre.leggauss(16)
        edges = np.concatenate([[0.0], np.logspace(-6, 0, 25)])
        middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        share = (middle[:, None] + half[:, None] * node).ravel()
        force = self.state_at(state, step, share * duration, duration)[0]
        return step * float((half[:, None] * weight).ravel() @ force)


def follow_creep(creeping: Creeping, path: np.ndarray) -> np.ndarray:
    """Rows as of `follow`; the strength may be passed by steps that take no time only."""
    return np.array(list(_creep(creeping, path)))


def _creep(own: Creeping, path: np.ndarray) -> Iterator[list[float]]:
    bond, state, opening, used, onset, reached = own.bond, np.zeros(2), 0.0, 0.0, None, 0.0
    peak = bond.f_n / bond.k_n
    for to, _, duration in path:
        step = to - opening
        jump = opening + own.d1 * (bond.f_n - state[0])
        if onset is None and not duration and to >= jump:
            onset, reached = jump, to
            used += own.stored(state) + 0.5 * (state[0] + bond.f_n) * (jump - opening)
            used += _branch_work(bond, onset, reached)
        elif onset is None:
            used += own.work(state, step, duration) + own.stored(state)
            state = own.after(state, step, duration)
            assert state[0] < bond.f_n, "only a jump may pass the strength here"
            used -= own.stored(state)
        elif to > reached:
            used += _branch_work(bond, onset, to) - _branch_work(bond, onset, reached)
            reached = to
        opening = to
        if onset is None:
            yield [state[0], 0.0, own.stored(state), used, 0.0, 0.0, 0.0]
            continue
        force, way = _softened(bond, to, onset, reached), _way(bond, onset, reached)
        stored = 0.5 * force * (force / bond.k_n if bond.elastic else to - _origin(bond, onset))
        yield [force, 0.0, stored, used, peak + way * (bond.d_n - peak), bond.harm(way, peak, bond.d_n), 0.0]


def _way(bond: Bond, onset: float, reached: float) -> float:
    if onset >= bond.d_n:
        return bond.branch.end
    return min((reached - onset) / (bond.d_n - onset), bond.branch.end)


def _origin(bond: Bond, onset: float) -> float:
    """Where a line of slope K(0) through the peak starts, if the bond has become shorter: there it is at rest."""
    return min(onset - bond.f_n / bond.k_n, 0.0)


def _softened(bond: Bond, opening: float, onset: float, reached: float) -> float:
    top = bond.f_n * bond.branch.left(_way(bond, onset, reached)) if onset < bond.d_n else 0.0
    own, furthest = opening - _origin(bond, onset), reached - _origin(bond, onset)
    if own <= 0:
        return bond.k_n * own
    return max(top - bond.k_n * (furthest - own), 0.0) if bond.elastic else top * own / furthest


def _branch_work(bond: Bond, onset: float, reached: float) -> float:
    """Area below the branch from δ* on, less what can be had back."""
    area = (
        bond.branch.integral(bond.branch.left, 0.0, _way(bond, onset, reached)) * bond.f_n * max(bond.d_n - onset, 0.0)
    )
    top = bond.f_n * bond.branch.left(_way(bond, onset, reached)) if onset < bond.d_n else 0.0
    return area - 0.5 * top * (top / bond.k_n if bond.elastic else reached - _origin(bond, onset))
