"""How two honest models of one test differ: amplitudes of modes, long waves along the CMOD, and a local remainder."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.core.errors import InputError
from pipeline.gap.modes import LOAD, MIRRORED, MODES, shapes
from pipeline.gap.observation import Sight

ALL = (*MODES, LOAD)
KNOTS = np.array([0.25, 0.6, 1.0, 2.3, 5.0, 12.0])  # CMOD over CMOD at peak, at which amplitudes of modes stand
MIDDLE = (0.5, 1.5, 6.0)  # the same for what is local
SPREAD = 5e-3  # m; reach of the remainder's correlation on one flank


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """A Gaussian process of unknown scale for what is left between test and simulation when the model lacks nothing.

    Mode i has at CMOD c the standard deviation aᵢ(c), linear in log c between the knots and in c before the first;
    Cov(bᵢ(c), bⱼ(c')) = aᵢ(c) aⱼ(c') Rᵢⱼ exp(−|c − c'|/length), which counts by 1 − `empirical`; the rest is the mean
    of the products of the specimens' own waves: what specimens have in common is not spread over all shapes. The load
    counts in shares of its largest value.

    What the modes leave is correlated alike along the CMOD, over `spread` on one flank, and not across the crack. Bonds
    that snap one by one move single points at single stations: `white`. Specimens differ in how much they differ: the
    variance of all modes of one test is that of the process times `tail`/χ² with `tail` degrees of freedom, so that
    differences follow Student's t.

    Parameters
    ----------
    amplitude : (k, knots) array; of `ALL`, m, and 1 for the load
    correlation : (k, k) array R
    remainder : (3,) array, m
    length : float, m of CMOD
    spread : float, m
    samples : int; specimens it was learnt from
    white : (3,) array, m; independent scatter of every displacement component in the stages
    waves : (n, k, knots) array; what specimens were left with, m, and 1 for the load
    empirical : float, 0 to 1; share of the waves in the covariance
    tail : float; degrees of freedom of the modes' scale, inf: it is known
    placements : float; how much the covariance counts of what other places of the lattice change, 0: not at all
    """

    amplitude: np.ndarray
    correlation: np.ndarray
    remainder: np.ndarray
    length: float
    spread: float = SPREAD
    samples: int = 1
    white: np.ndarray = field(default_factory=lambda: np.zeros(3))
    waves: np.ndarray = field(default_factory=lambda: np.zeros((0, len(ALL), KNOTS.size)))
    empirical: float = 0.0
    tail: float = np.inf
    placements: float = 0.0

    def __post_init__(self) -> None:
        k = len(ALL)
        if self.amplitude.shape != (k, KNOTS.size) or self.correlation.shape != (k, k) or self.remainder.shape != (3,):
            raise InputError(
                f"a discrepancy needs amplitudes (of {k} modes at {KNOTS.size} knots), correlations of them all and a "
                "remainder in three stages"
            )
        if self.waves.shape[1:] != self.amplitude.shape or (self.empirical > 0 and not len(self.waves)):
            raise InputError(f"waves of shape {self.waves.shape} are not those of specimens, modes and knots")
        if not (self.length > 0 and self.spread > 0 and self.samples >= 1 and (self.amplitude >= 0).all()):
            raise InputError("lengths and number of samples of a discrepancy must be positive, amplitudes not negative")
        if not (0 <= self.empirical <= 1 and self.tail > 0):
            raise InputError(f"empirical = {self.empirical:g} must lie between 0 and 1, tail = {self.tail:g} above 0")

    def scaled(self, modes: float, local: float = 1.0) -> Discrepancy:
        """With standard deviations of the modes, and of what is local, this many times as large."""
        return replace(
            self,
            amplitude=modes * self.amplitude,
            waves=modes * self.waves,
            remainder=local * self.remainder,
            white=local * self.white,
            placements=modes**2 * self.placements,
        )

    def widened(self, factor: np.ndarray | float) -> Discrepancy:
        """With standard deviations of single modes (k,), or of all, this many times as large."""
        by = np.broadcast_to(factor, len(ALL))[:, None]
        return replace(self, amplitude=by * self.amplitude, waves=by * self.waves)

    def covariance(self, sight: Sight, load_scale: float) -> np.ndarray:
        """Covariance (2sp + s, 2sp + s) of `Reading.flat`, m² and N²."""
        found = self.of_modes(sight, load_scale)
        cut = 2 * sight.cmod.size * len(sight.points)
        found[:cut, :cut] += self.local(sight)
        return found

    def of_modes(self, sight: Sight, load_scale: float) -> np.ndarray:
        """The part (2sp + s, 2sp + s) of it that has the modes' shapes."""
        s, p = sight.cmod.size, len(sight.points)
        size = self.amplitude @ hats(sight.progress).T
        along = np.exp(-np.abs(np.subtract.outer(sight.cmod, sight.cmod)) / self.length)
        spread = np.einsum("is,ij,jt,st->isjt", size, self.correlation, size, along)
        if self.empirical > 0:
            own = np.concatenate([self.waves, MIRRORED[:, None] * self.waves]) @ hats(sight.progress).T
            spread = (1 - self.empirical) * spread + self.empirical / len(own) * np.einsum("nis,njt->isjt", own, own)
        basis = shapes(sight).reshape(2 * p, len(MODES))
        cut = 2 * s * p
        found = np.zeros((cut + s, cut + s))
        fields = np.einsum("ai,isjt,bj->satb", basis, spread[:-1, :, :-1], basis, optimize=True)
        mixed = np.einsum("ai,ist->sat", basis, spread[:-1, :, -1], optimize=True)
        found[:cut, :cut] = fields.reshape(cut, cut)
        found[:cut, cut:] = load_scale * mixed.reshape(cut, s)
        found[cut:, :cut] = found[:cut, cut:].T
        found[cut:, cut:] = load_scale**2 * spread[-1, :, -1]
        return 0.5 * (found + found.T)  # round-off of sums in another order

    def local(self, sight: Sight) -> np.ndarray:
        """Covariance (2sp, 2sp), m², of remainder and white scatter; of displacements only."""
        s, p = sight.cmod.size, len(sight.points)
        along = np.exp(-np.abs(np.subtract.outer(sight.cmod, sight.cmod)) / self.length)
        size = along_cmod(self.remainder, sight.progress)
        flank = np.kron(flank_correlation(sight, self.spread), np.eye(2))
        found = np.einsum("s,t,st,ab->satb", size, size, along, flank, optimize=True).reshape(2 * s * p, 2 * s * p)
        return found + np.diag(np.repeat(along_cmod(self.white, sight.progress) ** 2, 2 * p))


def flank_correlation(sight: Sight, spread: float) -> np.ndarray:
    """exp(−d²/(2 spread²)) (p, p) between points on one flank, none across the crack."""
    square = np.sum((sight.points[:, None] - sight.points) ** 2, axis=-1)
    return np.exp(-square / (2 * spread**2)) * np.equal.outer(sight.side, sight.side)


def along_cmod(stages: np.ndarray, progress: np.ndarray) -> np.ndarray:
    """Values (s,) at CMOD over CMOD at peak (s,), from those of the three stages."""
    early = np.minimum(progress / MIDDLE[0], 1.0)
    return early * np.interp(np.log(np.maximum(progress, MIDDLE[0])), np.log(MIDDLE), stages)


def hats(progress: np.ndarray) -> np.ndarray:
    """Weights (s, knots) of the knots at CMOD over CMOD at peak (s,): in proportion to it before the first."""
    early = np.minimum(progress / KNOTS[0], 1.0)
    place = np.log(np.clip(progress, KNOTS[0], KNOTS[-1]))
    return early[:, None] * np.column_stack([np.interp(place, np.log(KNOTS), one) for one in np.eye(KNOTS.size)])
