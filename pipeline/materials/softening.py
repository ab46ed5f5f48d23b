"""Shapes of the softening branch, all of the same area: how much of the strength is left along the way.

The way is s = (δ − δ_peak)/(δ_max − δ_peak), 0 at the peak and 1 where the *linear* branch ends; g(s) is the share
of the strength that is left, g(0) = 1. Every shape has ∫ g ds = 1/2, so a bond needs f_max δ_max/2 to break whatever
its shape, and δ_max means the same for all: the end of the linear law of that area. Other shapes end later, at s_end.

linear         g = 1 − s, s_end = 1
exponential    g = (e^(−α s) − e^(−4α))/(1 − e^(−4α)), s_end = 4; α = 1.9945… gives the area 1/2
bilinear-tail  straight from (0, 1) to (s₁, 1/3) and from there to (s_end, 0), s_end = 3 (1 − s₁), with
               s₁ = 2/3 − 4/15 · tail: tail 0 is the linear law, tail 1 that of Petersson (1981, Lund TVBM-1006) for
               concrete: w₁ = 0.8 G_f/f_t, w_c = 3.6 G_f/f_t
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.core.errors import InputError

EXPONENTIAL_END = 4.0
EXPONENTIAL_RATE = 1.9945269342442677  # root of 1/α − 4/(e^(4α) − 1) = 1/2
KINK = 1 / 3  # share of the strength at the kink of the bilinear branch
NEWTON = 60  # iterations at most; a dozen are the rule


class Shape(StrEnum):
    """The softening branches by name."""

    LINEAR = "linear"
    EXPONENTIAL = "exponential"
    BILINEAR_TAIL = "bilinear-tail"


class Unloading(StrEnum):
    """Where a softened bond goes when it closes: straight to the origin, or along its first stiffness."""

    SECANT = "secant"
    ELASTIC = "elastic"


@dataclass(frozen=True)
class Softening:
    """One shape; functions of the way s, arrays of any shape, s ≥ 0.

    Parameters
    ----------
    shape : Shape
    tail : float in [0, 1]; of the bilinear branch, 0 linear … 1 long tail
    """

    shape: Shape = Shape.LINEAR
    tail: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", named_shape(self.shape))
        if not 0 <= self.tail <= 1:
            raise InputError(f"tail = {self.tail:g} must be between 0 (linear) and 1 (long tail)")

    @property
    def kink(self) -> float:
        """s₁ of the bilinear branch."""
        return 2 / 3 - 4 / 15 * self.tail

    @property
    def end(self) -> float:
        """s_end, where nothing is left."""
        if self.shape is Shape.EXPONENTIAL:
            return EXPONENTIAL_END
        return 3 * (1 - self.kink) if self.shape is Shape.BILINEAR_TAIL else 1.0

    def left(self, way: np.ndarray) -> np.ndarray:
        """g(s), clipped to 0–1."""
        way = np.asarray(way, float)
        if self.shape is Shape.LINEAR:
            values = 1 - way
        elif self.shape is Shape.EXPONENTIAL:
            values = _exponential(way)
        else:
            first, second = self._slopes()
            values = np.where(way <= self.kink, 1 - first * way, second * (self.end - way))
        return np.where(way >= self.end, 0.0, np.clip(values, 0.0, 1.0))

    def area(self, way: np.ndarray) -> np.ndarray:
        """∫₀^s g ds, 1/2 at the end."""
        at = np.clip(np.asarray(way, float), 0.0, self.end)
        if self.shape is Shape.LINEAR:
            return at - at**2 / 2
        if self.shape is Shape.EXPONENTIAL:
            last = np.exp(-EXPONENTIAL_RATE * EXPONENTIAL_END)
            return (-np.expm1(-EXPONENTIAL_RATE * at) / EXPONENTIAL_RATE - last * at) / (1 - last)
        first, second = self._slopes()
        return np.where(at <= self.kink, at - first * at**2 / 2, 0.5 - second * (self.end - at) ** 2 / 2)

    def way_of_damage(self, damage: np.ndarray, stretch: np.ndarray) -> np.ndarray:
        """The way s at which 1 − g(s)/(1 + s (stretch − 1)) is the given damage, 0 to 1.

        Parameters
        ----------
        damage : (m,) array; D of secant unloading
        stretch : (m,) array; δ_max/δ_peak, above 1
        """
        kept, way = 1 - np.asarray(damage, float), np.asarray(stretch, float) - 1
        if self.shape is Shape.LINEAR:
            return (1 - kept) / (1 + kept * way)
        if self.shape is Shape.EXPONENTIAL:
            return _newton(kept, way)
        first, second = self._slopes()
        near = (1 - kept) / (first + kept * way)
        return np.where(near <= self.kink, near, (second * self.end - kept) / (second + kept * way))

    def _slopes(self) -> tuple[float, float]:
        """−dg/ds before and after the kink."""
        return (1 - KINK) / self.kink, KINK / (self.end - self.kink)


def named_shape(name: str) -> Shape:
    """The shape of that name, as a bundle or a deck gives it."""
    if name not in tuple(Shape):
        raise InputError(f"softening = {name} must be linear, exponential or bilinear-tail")
    return Shape(name)


def named_unloading(name: str) -> Unloading:
    """The unloading of that name, as a bundle or a deck gives it."""
    if name not in tuple(Unloading):
        raise InputError(f"unloading = {name} must be secant or elastic")
    return Unloading(name)


LINEAR = Softening()


def _exponential(way: np.ndarray) -> np.ndarray:
    last = np.exp(-EXPONENTIAL_RATE * EXPONENTIAL_END)
    return (np.exp(-EXPONENTIAL_RATE * way) - last) / (1 - last)


def _newton(kept: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Root of g(s) = kept (1 + s stretch): convex and falling, so Newton from s = 0 never overshoots."""
    kept, stretch = np.broadcast_arrays(kept, stretch)
    last = np.exp(-EXPONENTIAL_RATE * EXPONENTIAL_END)
    way = np.zeros(kept.shape)
    for _ in range(NEWTON):
        falling = np.exp(-EXPONENTIAL_RATE * way) / (1 - last)
        rest = falling - last / (1 - last) - kept * (1 + way * stretch)
        further = way + rest / (EXPONENTIAL_RATE * falling + kept * stretch)
        if not np.any(further > way):
            break
        way = np.maximum(further, way)
    return np.minimum(np.where(kept <= 0, EXPONENTIAL_END, way), EXPONENTIAL_END)
