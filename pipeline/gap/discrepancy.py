"""How two honest models of one test differ: amplitudes of modes, long waves along the CMOD, and a local remainder."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import InputError
from pipeline.gap.modes import LOAD, MODES, amplitudes, shapes
from pipeline.gap.observation import STAGES, Observation, Sight

ALL = (*MODES, LOAD)
MIDDLE = (0.5, 1.5, 6.0)  # CMOD over CMOD at peak for which the amplitudes of the three stages stand
SPREAD = 5e-3  # m; reach of the remainder's correlation on one flank
LENGTHS = np.geomspace(0.05e-3, 5e-3, 41)  # m of CMOD, that are tried


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """A Gaussian process for what is left between test and simulation when the model lacks nothing.

    Mode i has at CMOD c the standard deviation aᵢ(c), linear in log c between the stages and in c before the first;
    Cov(bᵢ(c), bⱼ(c')) = aᵢ(c) aⱼ(c') Rᵢⱼ exp(−|c − c'|/length). The load counts in shares of its largest value. What
    the modes leave is correlated alike along the CMOD, over `spread` on one flank, and not across the crack. Bonds that
    snap one by one move single points at single stations: `white`.

    Parameters
    ----------
    amplitude : (k, 3) array; of `ALL` in the three stages, m, and 1 for the load
    correlation : (k, k) array R
    remainder : (3,) array, m
    length : float, m of CMOD
    spread : float, m
    samples : int; specimens it was learnt from
    white : (3,) array, m; independent scatter of every displacement component in the stages
    """

    amplitude: np.ndarray
    correlation: np.ndarray
    remainder: np.ndarray
    length: float
    spread: float = SPREAD
    samples: int = 1
    white: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        k = len(ALL)
        if self.amplitude.shape != (k, 3) or self.correlation.shape != (k, k) or self.remainder.shape != (3,):
            raise InputError(f"a discrepancy needs amplitudes (of {k} modes in 3 stages) and correlations of them all")
        if not (self.length > 0 and self.spread > 0 and self.samples >= 1 and (self.amplitude >= 0).all()):
            raise InputError("lengths and number of samples of a discrepancy must be positive, amplitudes not negative")

    def covariance(self, sight: Sight, load_scale: float) -> np.ndarray:
        """Covariance (2sp + s, 2sp + s) of `Reading.flat`, m² and N²."""
        s, p = sight.cmod.size, len(sight.points)
        along = np.exp(-np.abs(np.subtract.outer(sight.cmod, sight.cmod)) / self.length)
        size = np.stack([along_cmod(a, sight.progress) for a in self.amplitude])
        basis = shapes(sight).reshape(2 * p, len(MODES))
        root = self.correlation[:-1, :-1]
        fields = np.einsum("ai,is,ij,jt,bj,st->satb", basis, size[:-1], root, size[:-1], basis, along, optimize=True)
        local = along_cmod(self.remainder, sight.progress)
        flank = np.kron(flank_correlation(sight, self.spread), np.eye(2))
        fields += np.einsum("s,t,st,ab->satb", local, local, along, flank, optimize=True)
        mixed = np.einsum("ai,is,i,t,st->sat", basis, size[:-1], self.correlation[:-1, -1], size[-1], along)
        cut = 2 * s * p
        found = np.zeros((cut + s, cut + s))
        found[:cut, :cut] = fields.reshape(cut, cut) + np.diag(
            np.repeat(along_cmod(self.white, sight.progress) ** 2, 2 * p)
        )
        found[:cut, cut:] = load_scale * mixed.reshape(cut, s)
        found[cut:, :cut] = found[:cut, cut:].T
        found[cut:, cut:] = load_scale**2 * np.outer(size[-1], size[-1]) * along
        return 0.5 * (found + found.T)  # round-off of sums in another order


def flank_correlation(sight: Sight, spread: float) -> np.ndarray:
    """exp(−d²/(2 spread²)) (p, p) between points on one flank, none across the crack."""
    square = np.sum((sight.points[:, None] - sight.points) ** 2, axis=-1)
    return np.exp(-square / (2 * spread**2)) * np.equal.outer(sight.side, sight.side)


def along_cmod(stages: np.ndarray, progress: np.ndarray) -> np.ndarray:
    """Values (s,) at CMOD over CMOD at peak (s,), from those of the three stages."""
    early = np.minimum(progress / MIDDLE[0], 1.0)
    return early * np.interp(np.log(np.maximum(progress, MIDDLE[0])), np.log(MIDDLE), stages)


@dataclass(frozen=True, eq=False)
class Remnant:
    """What is left of one test without effects after the fit of the two parameters.

    Parameters
    ----------
    observation : Observation; its reading is measured − simulated, its noise that of the test
    load_scale : float, N
    """

    observation: Observation
    load_scale: float

    def waves(self, remainder: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes (k, s) of `ALL`, and the variance (k, s) that noise and remainder give them; NaN where unknown.

        Parameters
        ----------
        remainder : (1, 3) array, m; standard deviation in the stages, none where not given
        """
        o = self.observation
        s, p = o.sight.cmod.size, len(o.sight.points)
        use = o.mask[: 2 * s * p : 2].reshape(s, p)
        take = amplitudes(o.sight, use)
        field = np.where(use[..., None], o.reading.field, 0.0).reshape(s, 2 * p)
        noise = np.repeat(np.where(use, o.field_std, 0.0) ** 2, 2, axis=1)
        wave = np.einsum("ska,sa->ks", take, field)
        hiss = np.einsum("ska,sa->ks", take**2, noise)
        if remainder is not None:
            local = along_cmod(remainder[0], o.sight.progress) ** 2
            flank = np.kron(flank_correlation(o.sight, SPREAD), np.eye(2))
            hiss += local * np.einsum("ska,ab,skb->ks", take, flank, take, optimize=True)
        wave[:, use.sum(axis=1) < 6] = np.nan  # fewer points do not tell the modes apart
        return np.vstack([wave, o.reading.load / self.load_scale]), np.vstack(
            [hiss, (o.load_std / self.load_scale) ** 2]
        )

    def local(self) -> tuple[np.ndarray, np.ndarray]:
        """Size (1, s), m, of a remainder that leaves as much beside the modes; variance (1, s) of that by noise."""
        o = self.observation
        s, p = o.sight.cmod.size, len(o.sight.points)
        use = o.mask[: 2 * s * p : 2].reshape(s, p)
        take, basis = amplitudes(o.sight, use), shapes(o.sight).reshape(2 * p, -1)
        flank = np.kron(flank_correlation(o.sight, SPREAD), np.eye(2))
        square, noise = np.full(s, np.nan), np.full(s, np.nan)
        for station in np.flatnonzero(2 * use.sum(axis=1) > len(MODES)):
            seen = np.repeat(use[station], 2)
            beside = (np.eye(2 * p) - basis @ take[station])[np.ix_(seen, seen)]
            share = float(np.einsum("ab,bc,ac->", beside, flank[np.ix_(seen, seen)], beside, optimize=True))
            hiss = np.repeat(o.field_std[station], 2)[seen] ** 2
            square[station] = np.sum((beside @ o.reading.field[station].ravel()[seen]) ** 2) / share
            noise[station] = np.sum(beside**2 @ hiss) / share
        return np.sqrt(square)[None], noise[None]


def learn(remnants: list[Remnant]) -> Discrepancy:
    """The discrepancy that explains what effect-free tests leave.

    Amplitudes are second moments about zero (a bias of the simulator is a discrepancy too) with the noise taken off,
    enlarged by (n + 2)/n in variance, because n specimens are few. Correlations between modes are shrunk towards none
    with the weight k/(k + n) of k modes; the length is that whose exponential is nearest to the products of
    standardised amplitudes at two stations.

    Raises
    ------
    InputError
        for fewer than three specimens
    """
    if len(remnants) < 3:
        raise InputError(f"a discrepancy cannot be learnt from {len(remnants)} specimens: at least three are needed")
    n = len(remnants)
    few = (n + 2) / n
    remainder = _by_stage([(r.observation.sight, *r.local()) for r in remnants], few)
    waves = [(r.observation.sight, *r.waves(remainder)) for r in remnants]
    amplitude = _by_stage(waves, few)
    standard, heard = [], []
    for sight, wave, hiss in waves:
        size = np.stack([along_cmod(a, sight.progress) for a in np.where(amplitude > 0, amplitude, np.inf)])
        standard.append(np.sqrt(few) * wave / size)
        heard.append(1 / (1 + hiss / size**2))
    correlation = _correlation([w * h for w, h in zip(standard, heard, strict=True)], n)
    sights = [sight for sight, *_ in waves]
    return Discrepancy(amplitude, correlation, remainder[0], _length(sights, standard, heard), samples=n)


def _by_stage(parts: list[tuple[Sight, np.ndarray, np.ndarray]], factor: float) -> np.ndarray:
    """Standard deviations (k, 3) beyond noise in the three stages, from values (k, s) and the noise's variances."""
    found = []
    for stage in range(len(STAGES)):
        value = np.concatenate([v[:, sight.stage == stage] for sight, v, _ in parts], axis=1)
        noise = np.concatenate([h[:, sight.stage == stage] for sight, _, h in parts], axis=1)
        found.append(_root_mean(value**2, noise, factor))
    return np.column_stack(found)


def _root_mean(square: np.ndarray, noise: np.ndarray, factor: float) -> np.ndarray:
    """Root of the mean square (k, j) beyond noise; at least a tenth of the whole, zero where nothing is known."""
    known = np.isfinite(square)
    count = np.maximum(known.sum(axis=1), 1)
    total = np.where(known, square, 0.0).sum(axis=1) / count
    beyond = total - np.where(known, noise, 0.0).sum(axis=1) / count
    return np.sqrt(factor * np.maximum(beyond, 0.1 * total))


def _correlation(standard: list[np.ndarray], specimens: int) -> np.ndarray:
    k = len(ALL)
    total, count = np.zeros((k, k)), np.zeros((k, k))
    for wave in standard:
        known = np.isfinite(wave)
        value = np.where(known, wave, 0.0)
        total += value @ value.T
        count += known.astype(float) @ known.T
    moment = total / np.maximum(count, 1)
    scale = np.sqrt(np.diag(moment))
    scale = np.where(scale > 0, scale, 1.0)
    kept = specimens / (specimens + k)
    return kept * moment / np.outer(scale, scale) * (1 - np.eye(k)) + np.eye(k)


def _length(sights: list[Sight], standard: list[np.ndarray], heard: list[np.ndarray]) -> float:
    """The length (m) whose exponential is nearest to the products of amplitudes at two stations.

    Amplitudes (k, s) of unit variance count by the share (k, s) of what is heard that is not noise.
    """
    apart, product, weight = [], [], []
    for sight, wave, loud in zip(sights, standard, heard, strict=True):
        row, column = np.triu_indices(sight.cmod.size, 1)
        both, sure = wave[:, row] * wave[:, column], loud[:, row] * loud[:, column]
        known = np.isfinite(both)
        apart.append(np.broadcast_to(np.abs(sight.cmod[row] - sight.cmod[column]), both.shape)[known])
        product.append(both[known])
        weight.append(sure[known])
    distance, found, loud = (np.concatenate(x) for x in (apart, product, weight))
    wrong = [np.sum(loud * (found - np.exp(-distance / length)) ** 2) for length in LENGTHS]
    return float(LENGTHS[int(np.argmin(wrong))])
