"""Cohesive laws of bonds in pure opening: force against normal opening, with memory of the largest opening."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from pipeline.core.errors import InputError
from pipeline.materials.softening import LINEAR, Softening, Unloading, named_unloading

Factor = np.ndarray | float


@dataclass(frozen=True)
class CentralSoftening:
    """Softening of any shape in pure opening; one entry a bond.

    Elastic with K^n up to f_max at δ_peak = f_max/K^n, then f_max g(s) along the way
    s = (δ − δ_peak)/(δ_max − δ_peak) of `softening`. Unloading is secant, to the origin, or elastic: with K^n down to
    the plastic opening κ − f(κ)/K^n, below which the bond carries nothing until it is closed. Compression is elastic
    with K^n, counted from the unstretched bond, whatever has happened before. The only history is δ_reached, the
    largest opening seen, zero at the start. `reached` in the methods below is the one *before* the opening at hand:
    the law takes the larger of the two.

    Parameters
    ----------
    k_n : (m,) array, N/m, positive
    f_max : (m,) array, N, positive; inf: the bond takes no damage
    delta_max : (m,) array, m, larger than f_max/k_n; ignored where f_max is inf. Where the *linear* branch of the same
        area ends: the bond takes f_max δ_max/2 to break, whatever the shape
    softening : Softening
    unloading : Unloading
    """

    k_n: np.ndarray
    f_max: np.ndarray
    delta_max: np.ndarray
    softening: Softening = LINEAR
    unloading: Unloading = Unloading.SECANT
    delta_peak: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        names = ("k_n", "f_max", "delta_max")
        rows = np.broadcast_arrays(*(np.atleast_1d(np.asarray(getattr(self, n), float)) for n in names))
        for name, values in zip(names, rows, strict=True):
            object.__setattr__(self, name, values.copy())
        object.__setattr__(self, "unloading", named_unloading(self.unloading))
        refuse_values(self.k_n, self.f_max, self.delta_max)
        object.__setattr__(self, "delta_peak", self.f_max / self.k_n)
        refuse_brittle(self.delta_max, self.delta_peak)

    def of(self, bonds: np.ndarray) -> Self:
        """The law of some of the bonds: numbers (k,) or bools (m,)."""
        return replace(self, k_n=self.k_n[bonds], f_max=self.f_max[bonds], delta_max=self.delta_max[bonds])

    def scaled(self, factor: float) -> Self:
        """The law with strengths and openings multiplied: (s f_max, s δ_max) of every bond."""
        return replace(self, f_max=factor * self.f_max, delta_max=factor * self.delta_max)

    def times(self, stiffness: Factor, strength: Factor, opening: Factor) -> Self:
        """The law with stiffness, strength and last opening of every bond multiplied, each by a number or (m,)."""
        return replace(self, k_n=stiffness * self.k_n, f_max=strength * self.f_max, delta_max=opening * self.delta_max)

    def spared(self, bonds: np.ndarray) -> Self:
        """The law with some bonds (m,) bool that take no damage."""
        return replace(self, f_max=np.where(bonds, np.inf, self.f_max))

    @property
    def delta_end(self) -> np.ndarray:
        """Opening (m,), m, from which on the bond is broken; inf where it takes no damage."""
        free = np.isfinite(self.f_max)
        peak, last = np.where(free, self.delta_peak, 0.0), np.where(free, self.delta_max, 0.0)
        return np.where(free, last + (self.softening.end - 1) * (last - peak), np.inf)

    def reached(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Largest opening seen (m,), m, after the bonds were opened by `opening` (m,), m."""
        return np.maximum(opening, reached)

    def way(self, reached: np.ndarray) -> np.ndarray:
        """s (m,) at the largest opening `reached` (m,), m: 0 before the peak, not clipped at the end."""
        softened = reached > self.delta_peak
        peak = np.where(softened, self.delta_peak, 0.0)
        return np.where(softened, (reached - peak) / np.where(softened, self.delta_max - peak, 1.0), 0.0)

    def envelope(self, reached: np.ndarray) -> np.ndarray:
        """Force (m,), N, of bonds that are at their largest opening `reached` (m,), m, never negative."""
        softened = reached > self.delta_peak
        left = np.where(softened, self.f_max, 0.0) * self.softening.left(self.way(reached))
        return np.where(softened, left, self.k_n * np.maximum(reached, 0.0))

    def falling(self, opening: np.ndarray, bonds: np.ndarray) -> np.ndarray:
        """Force (k,), N, of some bonds (k,) that are opened beyond their δ_peak and farther than ever before."""
        peak = self.delta_peak[bonds]
        return self.f_max[bonds] * self.softening.left((opening - peak) / (self.delta_max[bonds] - peak))

    def secant(self, reached: np.ndarray) -> np.ndarray:
        """Force over opening (m,), N/m, at the largest opening `reached` (m,), m; K^n before the peak."""
        softened = reached > self.delta_peak
        return np.where(softened, self.envelope(reached) / np.where(softened, reached, 1.0), self.k_n)

    def plastic(self, reached: np.ndarray) -> np.ndarray:
        """Opening (m,), m, at which an unloaded bond is free of force; 0 with secant unloading."""
        if self.unloading is Unloading.SECANT:
            return np.zeros(np.broadcast(reached, self.k_n).shape)
        return np.where(reached > self.delta_peak, reached - self.envelope(reached) / self.k_n, 0.0)

    def force(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Force (m,), N, tension positive, at `opening` (m,), m, after `reached` (m,), m."""
        seen = np.maximum(opening, reached)
        if self.unloading is Unloading.SECANT:
            return opening * np.where(opening > 0, self.secant(seen), self.k_n)
        elastic = self.envelope(seen) - self.k_n * (seen - opening)  # no difference of near numbers at the envelope
        softened = (opening > 0) & (seen > self.delta_peak)
        return np.where(softened, np.maximum(elastic, 0.0), self.k_n * opening)

    def stored(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Recoverable energy (m,), J: half of force times opening, or f²/(2 K^n) where unloading is elastic."""
        force = self.force(opening, reached)
        return 0.5 * force * (opening if self.unloading is Unloading.SECANT else force / self.k_n)

    def dissipated(self, reached: np.ndarray) -> np.ndarray:
        """Energy (m,), J, used up when the largest opening was `reached`: area below the law less what is stored."""
        softened = reached > self.delta_peak
        at, peak = (np.where(softened, values, 0.0) for values in (reached, self.delta_peak))
        strength, way = (np.where(softened, v, 0.0) for v in (self.f_max, self.delta_max - peak))
        envelope = np.where(softened, self.envelope(at), 0.0)
        area = strength * (peak / 2 + way * self.softening.area(self.way(at)))
        return area - 0.5 * envelope * (at if self.unloading is Unloading.SECANT else envelope / self.k_n)

    def damage(self, reached: np.ndarray) -> np.ndarray:
        """D (m,) = 1 − secant/K^n: 0 elastic, 1 broken."""
        return 1.0 - self.secant(reached) / self.k_n

    def softened_share(self, reached: np.ndarray) -> np.ndarray:
        """s/s_end (m,), 0–1: what maps show, even where D is near 1 at once."""
        return np.minimum(self.way(reached) / self.softening.end, 1.0)


@dataclass(frozen=True)
class LinearSoftening(CentralSoftening):
    """Linear softening in pure opening with secant unloading; one entry a bond.

    The straight line from f_max at δ_peak to zero at δ_max, counted from the unstretched bond; unloading goes straight
    to the origin (Hill et al. 2017, Fig. 6). Parameters and history as of `CentralSoftening`; closed forms.
    """

    softening: Softening = field(init=False, default=LINEAR, repr=False)
    unloading: Unloading = field(init=False, default=Unloading.SECANT, repr=False)

    def envelope(self, reached: np.ndarray) -> np.ndarray:
        """Force (m,), N, of bonds that are at their largest opening `reached` (m,), m, never negative."""
        with np.errstate(invalid="ignore"):  # inf/inf of bonds without damage, replaced below
            falling = self.f_max * (self.delta_max - reached) / (self.delta_max - self.delta_peak)
        softened = reached > self.delta_peak
        return np.where(softened, np.maximum(falling, 0.0), self.k_n * np.maximum(reached, 0.0))

    def secant(self, reached: np.ndarray) -> np.ndarray:
        """Stiffness (m,), N/m, of unloading and reloading in tension after the opening `reached` (m,), m."""
        softened = reached > self.delta_peak
        return np.where(softened, self.envelope(reached) / np.where(softened, reached, 1.0), self.k_n)

    def force(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Force (m,), N, tension positive, at `opening` (m,), m, after `reached` (m,), m."""
        return opening * np.where(opening > 0, self.secant(np.maximum(opening, reached)), self.k_n)

    def stored(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Recoverable energy (m,), J: half of force times opening, for unloading is to the origin."""
        return 0.5 * opening * self.force(opening, reached)

    def dissipated(self, reached: np.ndarray) -> np.ndarray:
        """Energy (m,), J, used up when the largest opening was `reached`: ½(f_max κ − f(κ) δ_peak), κ ≤ δ_max."""
        softened = reached > self.delta_peak
        at = np.where(softened, np.minimum(reached, self.delta_max), 0.0)
        strength, peak = np.where(softened, self.f_max, 0.0), np.where(softened, self.delta_peak, 0.0)
        return 0.5 * (strength * at - self.envelope(at) * peak)


def refuse_values(k_n: np.ndarray, f_max: np.ndarray, delta_max: np.ndarray) -> None:
    """Refuse what is not a positive number; delta_max only where the bond can take damage."""
    damageable = np.isfinite(f_max)
    rules = (
        ("k_n", "N/m", k_n, np.isfinite(k_n) & (k_n > 0), "finite and positive"),
        ("f_max", "N", f_max, f_max > 0, "positive (inf: the bond takes no damage)"),
        ("delta_max", "m", delta_max, ~damageable | (np.isfinite(delta_max) & (delta_max > 0)), "finite and positive"),
    )
    for name, unit, values, good, rule in rules:
        if not np.all(good):
            raise InputError(f"{name} = {values[~good][0]:g} {unit} must be {rule}")


def refuse_brittle(delta_max: np.ndarray, delta_peak: np.ndarray) -> None:
    """Refuse a softening branch that would run backwards."""
    bad = np.isfinite(delta_peak) & (delta_max <= delta_peak)
    if np.any(bad):
        raise InputError(
            f"delta_max = {delta_max[bad][0]:g} m must be larger than delta_peak = f_max/k_n = "
            f"{delta_peak[bad][0]:g} m: raise delta_max or lower f_max"
        )
