"""Learning a discrepancy from what the diagnosing model leaves of tests that lack nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.gap.discrepancy import ALL, KNOTS, SPREAD, Discrepancy, along_cmod, flank_correlation, hats
from pipeline.gap.gate import mode_operators
from pipeline.gap.modes import MIRRORED, MODES, REMAINDER, amplitudes, shapes
from pipeline.gap.observation import STAGES, Observation, Sight

LENGTHS = np.geomspace(0.05e-3, 5e-3, 41)  # m of CMOD, that are tried
BELIEF = 4.0  # degrees of freedom by which one test's local scatter is held to the library's
FLAT = 0.05  # how much one knot of a wave may be unlike none at the price of one station


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


def local_factor(rest: Observation, discrepancy: Discrepancy) -> float:
    """How many times as large as the discrepancy says what is local is in one test.

    Bonds that snap in one specimen and not in another make local scatter as different as specimens are. What is left
    beside the modes tells of it, whatever the modes do; it is drawn to one as by `BELIEF` degrees of freedom. The
    degrees of freedom of a quadratic form of covariance C are (tr C)²/tr C² (Satterthwaite 1946).

    Parameters
    ----------
    rest : Observation; its reading is measured − simulated
    discrepancy : Discrepancy
    """
    operators = mode_operators(rest)
    if REMAINDER not in operators:
        return 1.0
    beside, cut = operators[REMAINDER], rest.reading.field.size
    mask = rest.mask
    local = np.zeros((mask.size, mask.size))
    local[:cut, :cut] = discrepancy.local(rest.sight)
    expected = beside @ local[np.ix_(mask, mask)] @ beside.T
    noise = beside * rest.noise[mask] @ beside.T
    square = float(np.sum((beside @ rest.reading.flat()[mask]) ** 2))
    ratio = max((square - np.trace(noise)) / np.trace(expected), 0.0)
    whole = ratio * expected + noise
    freedom = np.trace(whole) ** 2 / np.sum(whole**2)
    return float(np.sqrt((BELIEF + freedom * ratio) / (BELIEF + freedom)))


def learn(remnants: list[Remnant], empirical: float = 0.0) -> Discrepancy:
    """The discrepancy that explains what effect-free tests leave, of known scale.

    Amplitudes are second moments about zero (a bias of the simulator is a discrepancy too) with the noise taken off,
    enlarged by (n + 2)/n in variance, because n specimens are few. Correlations between modes are shrunk towards none
    with the weight k/(k + n) of k modes, and those between modes that a mirror treats differently are none: no side is
    another. The length is that whose exponential is nearest to the products of
    standardised amplitudes at two stations.

    Parameters
    ----------
    remnants : list of Remnant
    empirical : float; see `Discrepancy`

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
    amplitude = _at_knots(waves, few)
    standard, heard = [], []
    for sight, wave, hiss in waves:
        size = np.where(amplitude > 0, amplitude, np.inf) @ hats(sight.progress).T
        standard.append(np.sqrt(few) * wave / size)
        heard.append(1 / (1 + hiss / size**2))
    correlation = _correlation([w * h for w, h in zip(standard, heard, strict=True)], n)
    sights = [sight for sight, *_ in waves]
    return Discrepancy(
        amplitude,
        correlation,
        remainder[0],
        _length(sights, standard, heard),
        samples=n,
        waves=np.array([_knotted(sight, wave) for sight, wave, _ in waves]),
        empirical=empirical,
    )


def _by_stage(parts: list[tuple[Sight, np.ndarray, np.ndarray]], factor: float) -> np.ndarray:
    """Standard deviations (k, 3) beyond noise in the three stages, from values (k, s) and the noise's variances."""
    found = []
    for stage in range(len(STAGES)):
        value = np.concatenate([v[:, sight.stage == stage] for sight, v, _ in parts], axis=1)
        noise = np.concatenate([h[:, sight.stage == stage] for sight, _, h in parts], axis=1)
        found.append(_root_mean(value**2, noise, factor))
    return np.column_stack(found)


def _at_knots(parts: list[tuple[Sight, np.ndarray, np.ndarray]], factor: float) -> np.ndarray:
    """The same (k, knots) at the knots, every station counting for its neighbours."""
    square, noise, count = (np.zeros((len(ALL), KNOTS.size)) for _ in range(3))
    for sight, value, hiss in parts:
        early = np.minimum(sight.progress / KNOTS[0], 1.0)
        weight = (hats(sight.progress) / early[:, None]) * np.isfinite(value)[..., None]
        square += np.einsum("ks,ksj->kj", np.nan_to_num(value / early) ** 2, weight)
        noise += np.einsum("ks,ksj->kj", np.nan_to_num(hiss / early**2), weight)
        count += weight.sum(axis=1)
    total, hiss = square / np.maximum(count, 1e-9), noise / np.maximum(count, 1e-9)
    return np.sqrt(factor * np.maximum(total - hiss, 0.1 * total))


def _knotted(sight: Sight, wave: np.ndarray) -> np.ndarray:
    """A wave (k, s) by its values (k, knots) at the knots; knots that no station tells of are none."""
    found, weight, still = np.zeros((len(ALL), KNOTS.size)), hats(sight.progress), FLAT * np.eye(KNOTS.size)
    for row, value in zip(found, wave, strict=True):
        known = np.isfinite(value)
        told = np.append(value[known], np.zeros(KNOTS.size))
        row[:] = np.linalg.lstsq(np.vstack([weight[known], still]), told, rcond=None)[0]
    return found


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
    alike = np.equal.outer(MIRRORED, MIRRORED)
    return kept * alike * moment / np.outer(scale, scale) * (1 - np.eye(k)) + np.eye(k)


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
