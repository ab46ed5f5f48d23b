"""Cohesive laws of bonds: force against normal opening, with memory of the largest opening."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import InputError


@dataclass(frozen=True)
class LinearSoftening:
    """Linear softening in pure opening with secant unloading; one entry a bond.

    Elastic with K^n up to f_max at δ_peak = f_max/K^n, then a straight line to zero at δ_max, counted
    from the unstretched bond; unloading goes straight to the origin; compression is elastic with K^n,
    whatever has happened before (Hill et al. 2017, Fig. 6). The only history is δ_reached, the
    largest opening seen, zero at the start. `reached` in the methods below is the one *before* the
    opening at hand: the law takes the larger of the two.

    Parameters
    ----------
    k_n : (m,) array, N/m, positive
    f_max : (m,) array, N, positive; inf: the bond takes no damage
    delta_max : (m,) array, m, larger than f_max/k_n; ignored where f_max is inf
    """

    k_n: np.ndarray
    f_max: np.ndarray
    delta_max: np.ndarray
    delta_peak: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        names = ("k_n", "f_max", "delta_max")
        rows = np.broadcast_arrays(*(np.atleast_1d(np.asarray(getattr(self, n), float)) for n in names))
        for name, values in zip(names, rows, strict=True):
            object.__setattr__(self, name, values.copy())
        _refuse_values(self.k_n, self.f_max, self.delta_max)
        object.__setattr__(self, "delta_peak", self.f_max / self.k_n)
        _refuse_brittle(self.delta_max, self.delta_peak)

    def of(self, bonds: np.ndarray) -> LinearSoftening:
        """The law of some of the bonds: numbers (k,) or bools (m,)."""
        return LinearSoftening(self.k_n[bonds], self.f_max[bonds], self.delta_max[bonds])

    def reached(self, opening: np.ndarray, reached: np.ndarray) -> np.ndarray:
        """Largest opening seen (m,), m, after the bonds were opened by `opening` (m,), m."""
        return np.maximum(opening, reached)

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

    def damage(self, reached: np.ndarray) -> np.ndarray:
        """D (m,) = 1 − secant/K^n: 0 elastic, 1 broken."""
        return 1.0 - self.secant(reached) / self.k_n

    def softened_share(self, reached: np.ndarray) -> np.ndarray:
        """(κ − δ_peak)/(δ_max − δ_peak) (m,), clipped to 0–1: what maps show, even where D is near 1 at once."""
        softened = reached > self.delta_peak
        way = np.where(softened, self.delta_max - np.where(softened, self.delta_peak, 0.0), 1.0)
        return np.where(softened, np.minimum((reached - np.where(softened, self.delta_peak, 0.0)) / way, 1.0), 0.0)


def _refuse_values(k_n: np.ndarray, f_max: np.ndarray, delta_max: np.ndarray) -> None:
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


def _refuse_brittle(delta_max: np.ndarray, delta_peak: np.ndarray) -> None:
    """Refuse a softening branch that would run backwards."""
    bad = np.isfinite(delta_peak) & (delta_max <= delta_peak)
    if np.any(bad):
        raise InputError(
            f"delta_max = {delta_max[bad][0]:g} m must be larger than delta_peak = f_max/k_n = "
            f"{delta_peak[bad][0]:g} m: raise delta_max or lower f_max"
        )
