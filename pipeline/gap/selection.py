"""A library's entry from what fits leave of effect-free tests: each left out in turn says how wide the others' Σ is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import stats
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.special import logsumexp

from pipeline.gap.discrepancy import ALL, Discrepancy
from pipeline.gap.gate import Gate, gate
from pipeline.gap.learning import Remnant, learn, local_factor
from pipeline.gap.seeming import Seeming, apparent

FACTORS = np.geomspace(0.02, 50.0, 23)  # of the variance of all modes, that are tried
SCALES = np.geomspace(0.1, 3.0, 30)  # of the same, for all specimens
TAILS = np.array([1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0])  # degrees of freedom
SHARES = (0.4, 0.7)  # of the specimens' own waves in the covariance, that are tried
PLACED = (0.0, 0.5, 1.0)  # of what other places of the lattice change, that are tried
QUIET = 1.5  # Σ over noise, below which a direction says what scatter there is beside the waves


@dataclass(frozen=True, eq=False)
class Rest:
    """What the fit of the two parameters leaves of a specimen.

    Parameters
    ----------
    remnant : Remnant
    slopes : (n, q) array; derivatives of the prediction by the parameters, in any unit
    scatter : (n, n) array; covariance of the simulations' own scatter
    elsewhere : (n, n) array; mean product of what other places of the lattice change, or 0
    effects : physics effect → (n,) array; what a value of one changes
    """

    remnant: Remnant
    slopes: np.ndarray
    scatter: np.ndarray
    elsewhere: np.ndarray | float = 0.0
    effects: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def values(self) -> np.ndarray:
        """The data that are there, measured − simulated; (n,)."""
        o = self.remnant.observation
        return o.reading.flat()[o.mask]

    def beside(self, discrepancy: Discrepancy) -> tuple[np.ndarray, np.ndarray]:
        """Covariances (n, n): what is known, with noise; and the modes, whose scale is not."""
        o = self.remnant.observation
        some = np.ix_(o.mask, o.mask)
        local, cut = np.diag(o.noise), o.reading.field.size
        local[:cut, :cut] += discrepancy.local(o.sight)
        modes = discrepancy.of_modes(o.sight, self.remnant.load_scale)[some]
        return local[some] + self.scatter, modes + discrepancy.placements * self.elsewhere


@dataclass(frozen=True)
class Scale:
    """The variance of the modes of one specimen is `typical` × `tail`/χ² times what the discrepancy says."""

    typical: float
    tail: float
    log_density: float


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A specimen beside the discrepancy of the others.

    Parameters
    ----------
    rest : Rest
    fixed, modes : (n, n) arrays; covariances of known and of unknown scale
    densities : (factors,) array; log density at every factor of the variance of the modes
    local : float; factor of the local scatter
    """

    rest: Rest
    fixed: np.ndarray
    modes: np.ndarray
    densities: np.ndarray
    local: float

    def gate(self, factor: float) -> Gate:
        """χ² by modes when the variance of the modes is so many times as large."""
        o = self.rest.remnant.observation
        return gate(o, self.rest.values, self.fixed + factor * self.modes, 1.0)

    def own(self, scale: Scale) -> float:
        """The specimen's own factor: the harmonic mean of what is likely."""
        weight = self.densities + log_share(scale.typical, scale.tail)
        share = np.exp(weight - logsumexp(weight))
        return float(1 / (share @ (1 / FACTORS)))


@dataclass(frozen=True, eq=False)
class Selected:
    """A discrepancy and what left-out specimens say of it.

    Parameters
    ----------
    discrepancy : Discrepancy
    freedom : float; second degrees of freedom of F, for the gate
    check : mode → mean χ² over degrees of freedom, at each specimen's own scale
    log_density : float; of all specimens left out
    apparent : physics effect → standard deviation of the value that specimens seem to have
    """

    discrepancy: Discrepancy
    freedom: float
    check: dict[str, float]
    log_density: float
    apparent: dict[str, float]


def selected(
    rests: Sequence[Rest],
    least: Mapping[str, float] | None = None,
    shares: Sequence[float] = SHARES,
    placed: Sequence[float] = PLACED,
) -> Selected:
    """The discrepancy of all, with the share of their own waves and the scales that are likeliest for those left out.

    Modes in which specimens left out are still farther off than they should be are widened by just that.

    Parameters
    ----------
    rests : Rest of every specimen, at least four
    least : effect → standard deviation that specimens seem to have in any case
    shares, placed : that are tried
    """
    tried = [(share, place, left_out(rests, share, place)) for share in shares for place in placed]
    found = [(scale_of([o.densities for o in left]), share, place, left) for share, place, left in tried]
    scale, share, place, left = max(found, key=lambda one: one[0].log_density)
    wider = np.array([max(checked(left, scale).get(mode, 1.0), 1.0) for mode in ALL])
    left = left_out(rests, share, place, wider)
    scale = scale_of([o.densities for o in left])
    local = float(np.exp(np.mean([np.log(o.local) for o in left])))
    gates = [o.gate(scale.typical) for o in left]
    widest = learnt(rests, share, place).widened(np.sqrt(wider))
    return Selected(
        replace(widest.scaled(np.sqrt(scale.typical), local), tail=scale.tail),
        freedom_of([(g.ratio[m], g.freedom[m]) for g in gates for m in g.ratio]),
        checked(left, scale),
        scale.log_density,
        apparent([seeming(one, scale) for one in left], least),
    )


def checked(left: Sequence[LeftOut], scale: Scale) -> dict[str, float]:
    """Mode → mean χ² over degrees of freedom of specimens left out, each at its own scale."""
    found: dict[str, list[float]] = {}
    for one in left:
        for mode, ratio in one.gate(one.own(scale)).ratio.items():
            found.setdefault(mode, []).append(ratio)
    return {mode: float(np.mean(values)) for mode, values in found.items()}


def seeming(one: LeftOut, scale: Scale) -> Seeming:
    """What is left of a specimen, and effects, in standard deviations of what the others say, beside the parameters."""
    root = cholesky(one.fixed + one.own(scale) * one.modes, lower=True)
    base = np.linalg.qr(solve_triangular(root, one.rest.slopes, lower=True))[0]

    def beside(values: np.ndarray) -> np.ndarray:
        white = solve_triangular(root, values, lower=True)
        return np.asarray(white - base @ (base.T @ white))

    return Seeming(beside(one.rest.values), {name: beside(x) for name, x in one.rest.effects.items()})


def learnt(rests: Sequence[Rest], share: float, place: float = 0.0) -> Discrepancy:
    """The discrepancy with the scatter that no wave explains; of typical scale for the mean of squares."""
    found = replace(learn([r.remnant for r in rests], share), placements=place)
    square, expected, noise = np.sum([_heard(r, found) for r in rests], axis=0).T
    excess = square / np.maximum(expected, 1e-9) - 1
    return replace(found, white=np.sqrt(np.maximum(excess, 0.0) * noise / len(rests)))


def left_out(rests: Sequence[Rest], share: float, place: float = 0.0, wider: np.ndarray | float = 1.0) -> list[LeftOut]:
    """Every specimen beside what the others say, the variances of the modes times `wider` (k,)."""
    found, white = [], learnt(rests, share, place).white
    for k, rest in enumerate(rests):
        others = [r.remnant for i, r in enumerate(rests) if i != k]
        model = replace(learn(others, share), white=white, placements=place).widened(np.sqrt(wider))
        factor = local_factor(rest.remnant.observation, model)
        fixed, modes = rest.beside(model.scaled(1.0, factor))
        found.append(LeftOut(rest, fixed, modes, restricted(rest.values, rest.slopes, fixed, modes), factor))
    return found


def restricted(residual: np.ndarray, slopes: np.ndarray, fixed: np.ndarray, modes: np.ndarray) -> np.ndarray:
    """Log density of what a fit leaves, for every factor of `FACTORS` on the variance of the modes.

    Restricted likelihood (Patterson and Thompson 1971): the parameters are integrated out, flat, so that it is the same
    wherever they were when the residual was taken.

    Parameters
    ----------
    residual : (n,) array
    slopes : (n, q) array; derivatives of the prediction by the parameters
    fixed, modes : (n, n) arrays; covariances, of known and of unknown scale
    """
    found = []
    for factor in FACTORS:
        root = cho_factor(fixed + factor * modes, lower=True)
        solved, across = cho_solve(root, residual), cho_solve(root, slopes)
        normal = slopes.T @ across
        moved = slopes.T @ solved
        square = residual @ solved - moved @ np.linalg.solve(normal, moved)
        determinant = 2 * np.log(np.diag(root[0])).sum() + np.linalg.slogdet(normal)[1]
        found.append(-0.5 * (square + determinant))
    return np.array(found)


def scale_of(densities: Sequence[np.ndarray]) -> Scale:
    """The most likely spread of scales, from log densities (factors,) of specimens left out."""
    best = Scale(1.0, np.inf, -np.inf)
    for typical in SCALES:
        for tail in TAILS:
            share = log_share(typical, tail)
            total = float(sum(logsumexp(d + share) for d in densities))
            if total > best.log_density:
                best = Scale(float(typical), float(tail), total)
    return best


def log_share(typical: float, tail: float) -> np.ndarray:
    """Logarithm of the probability of every factor of `FACTORS`: typical × tail/χ² with `tail` degrees of freedom."""
    square = tail * typical / FACTORS
    density = stats.chi2.logpdf(square, tail) + np.log(square)  # per logarithm of the factor
    return density - logsumexp(density)


def freedom_of(ratios: Sequence[tuple[float, int]]) -> float:
    """Second degrees of freedom of F that make χ² over degrees of freedom of specimens left out most likely.

    Parameters
    ----------
    ratios : (χ² over degrees of freedom, degrees of freedom) of modes and specimens
    """
    value, freedom = np.array(ratios, float).T
    tried = np.geomspace(1.0, 100.0, 60)
    return float(max(tried, key=lambda tail: stats.f.logpdf(value, freedom, tail).sum()))


def _heard(rest: Rest, discrepancy: Discrepancy) -> np.ndarray:
    """For every stage how many times noise the differences hold where the discrepancy says next to nothing; (3, 3).

    Columns: sum of squares over noise, expected sum, and noise (m²). The directions are those in which Σ is less than
    half again as large as noise.
    """
    o = rest.remnant.observation
    left, noise, p = rest.values, o.noise[o.mask], len(o.sight.points)
    covariance = np.sum(rest.beside(discrepancy), axis=0)
    stage = np.concatenate([np.repeat(o.sight.stage, 2 * p), np.full(o.sight.cmod.size, -1)])[o.mask]
    found = np.zeros((3, 3))
    for k in range(3):
        here = stage == k
        if not here.any():
            continue
        root = np.sqrt(noise[here])
        size, shape = np.linalg.eigh(covariance[np.ix_(here, here)] / np.outer(root, root))
        quiet = size < QUIET
        found[k] = np.sum((shape.T @ (left[here] / root))[quiet] ** 2), size[quiet].sum(), np.mean(noise[here])
    return found
