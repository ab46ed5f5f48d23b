"""The law of an edge: a potential of one effective opening λ = √(⟨δ_n⟩² + β² δ_s²) (after Tvergaard 1990).

Traction rises with a stiff penalty to the strength and softens from there; both components come from the potential,
t_n = σ(λ) ⟨δ_n⟩/λ and t_s = β² σ(λ) δ_s/λ, so pure sliding is β times as strong as opening and costs the same energy.
Closing to the origin; contact is as stiff as the penalty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

KNEE = 1 / 3  # share of the strength at the knee of the softening branch
FLOOR = 1e-8  # of the penalty, left to a parted edge so that no triangle flies off


@dataclass(frozen=True)
class Branch:
    """Share of the strength left along the softening branch s, 0 at the strength and 1 where a straight one ends.

    tail 0 is straight; tail 1 goes over Petersson's knee at (0.8 G/f, f/3) to 3.6 G/f; all have the area 1/2.
    """

    tail: float = 0.0

    @property
    def knee(self) -> float:
        """s of the knee: between the straight line's own point of that height and Petersson's."""
        return (1 - self.tail) * (1 - KNEE) + self.tail * 0.4

    @property
    def end(self) -> float:
        """s where nothing is left; the area 1/2 fixes it."""
        return self.knee + (1 - (1 + KNEE) * self.knee) / KNEE

    def _corners(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array([0.0, self.knee, self.end]), np.array([1.0, KNEE, 0.0])

    def left(self, s: np.ndarray) -> np.ndarray:
        """Share of the strength at s ≥ 0."""
        at, value = self._corners()
        return np.interp(s, at, value)

    def slope(self, s: np.ndarray) -> np.ndarray:
        """Its derivative; 0 behind the end."""
        at, value = self._corners()
        steep = np.append(np.diff(value) / np.diff(at), 0.0)
        return steep[np.clip(np.searchsorted(at, s, side="right") - 1, 0, 2)]

    def area(self, s: np.ndarray) -> np.ndarray:
        """Integral from 0 to s."""
        at, value = self._corners()
        s = np.minimum(s, self.end)
        whole = np.concatenate([[0.0], np.cumsum(np.diff(at) * (value[1:] + value[:-1]) / 2)])
        piece = np.clip(np.searchsorted(at, s, side="right") - 1, 0, 1)
        step = s - at[piece]
        return whole[piece] + step * (value[piece] + self.left(s)) / 2


@dataclass(frozen=True, eq=False)
class Edges:
    """Properties of integration points on edges; arrays (q,).

    Parameters
    ----------
    penalty : Pa/m
    strength : Pa
    last : m; opening at which the straight branch ends
    beta : float; strength in sliding over that in opening
    branch : Branch
    """

    penalty: np.ndarray
    strength: np.ndarray
    last: np.ndarray
    beta: float
    branch: Branch

    def at(self, chosen: np.ndarray) -> Edges:
        """Only some of the points (q,) bool."""
        return replace(self, penalty=self.penalty[chosen], strength=self.strength[chosen], last=self.last[chosen])

    @property
    def first(self) -> np.ndarray:
        """λ at the strength (q,), m."""
        return self.strength / self.penalty

    def way(self, reached: np.ndarray) -> np.ndarray:
        """s at the largest λ seen."""
        return np.maximum(reached - self.first, 0.0) / (self.last - self.first)

    def effective(self, opening: np.ndarray) -> np.ndarray:
        """λ (q,) of openings (q, 2): normal, tangential."""
        return np.hypot(np.maximum(opening[:, 0], 0.0), self.beta * opening[:, 1])

    def stress(self, reached: np.ndarray) -> np.ndarray:
        """σ(λ) on the branch (q,), Pa."""
        return self.strength * self.branch.left(self.way(reached))

    def secant(self, reached: np.ndarray) -> np.ndarray:
        """σ(λ)/λ (q,), Pa/m, and the floor."""
        return self.stress(reached) / np.maximum(reached, self.first) + FLOOR * self.penalty

    def traction(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """(q, 2), Pa, when the largest λ seen before is `reached`."""
        stiff = self.secant(np.maximum(self.effective(opening), reached))
        normal = np.where(opening[:, 0] > 0, stiff, self.penalty) * opening[:, 0]
        return np.column_stack([normal, self.beta**2 * stiff * opening[:, 1]])

    def energy(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Stored and, beyond what `reached` has cost, dissipated energy (q,), J/m²; its gradient is the traction."""
        now = self.effective(opening)
        seen = np.maximum(now, np.maximum(reached, self.first))
        contact = 0.5 * self.penalty * np.minimum(opening[:, 0], 0.0) ** 2
        return contact + 0.5 * self.secant(seen) * now**2 + self.dissipated(seen)

    def stored(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Energy (q,) that comes back, J/m²; `reached` includes this opening."""
        contact = 0.5 * self.penalty * np.minimum(opening[:, 0], 0.0) ** 2
        return contact + 0.5 * self.secant(reached) * self.effective(opening) ** 2

    def dissipated(self, reached: np.ndarray) -> np.ndarray:
        """Energy (q,) lost when the largest λ seen is `reached`, J/m²."""
        seen = np.maximum(reached, self.first)
        under = self.strength * (self.last - self.first) * self.branch.area(self.way(seen))
        return 0.5 * self.strength * self.first + under - 0.5 * self.stress(seen) * seen

    def tangent(self, opening: np.ndarray, reached: np.ndarray, softening: float = 1.0) -> np.ndarray:
        """Derivative (q, 2, 2) of the traction, Pa/m; with the given share of its softening, 0: a convex model."""
        now = self.effective(opening)
        stiff = self.secant(np.maximum(now, reached))
        found = np.zeros((len(now), 2, 2))
        opened = opening[:, 0] > 0
        found[:, 0, 0] = np.where(opened, stiff, self.penalty)
        found[:, 1, 1] = self.beta**2 * stiff
        if not softening:
            return found
        going = np.flatnonzero(now > np.maximum(reached, self.first))
        falling = (self.strength * self.branch.slope(self.way(now)) / (self.last - self.first))[going]
        lean = np.column_stack([np.maximum(opening[:, 0], 0.0), self.beta**2 * opening[:, 1]])[going]
        share = softening * (falling - stiff[going]) / now[going] ** 2
        found[going] += share[:, None, None] * lean[:, :, None] * lean[:, None, :]
        return found
