"""How far the gap closes: candidates are fitted to a part of the data and judged by the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.units import UM
from pipeline.gap.candidate import Candidate, Predict
from pipeline.gap.fit import Data, best_point
from pipeline.gap.observation import STAGES, Observation

DRAWS = 400
POINT_PARTS = 2
BOX_PRECISION = 12.0  # one over the variance of a flat distribution of width one
ACROSS = ("load from field", "field from load")


@dataclass(frozen=True, eq=False)
class Fold:
    """Data that are held out.

    Parameters
    ----------
    name : str
    held : (n,) bool array; of the data that are there
    """

    name: str
    held: np.ndarray


@dataclass(frozen=True)
class Distance:
    """Root mean square difference: in µm, in N, and in standard deviations of noise and discrepancy; NaN: no data."""

    displacement_um: float
    load_n: float
    scaled: float


@dataclass(frozen=True)
class Share:
    """The share of a gap that is closed.

    Parameters
    ----------
    fraction : float; (g₀ − g₁)/(g₀ − g_floor), NaN where there is nothing to close
    interval : (low, high), 95 %, block bootstrap
    before, after : float; g₀ and g₁, scaled
    floor : float; what noise and discrepancy alone leave, scaled
    nothing : bool; g₀ is within two standard deviations of the floor
    """

    fraction: float
    interval: tuple[float, float]
    before: float
    after: float
    floor: float
    nothing: bool


@dataclass(frozen=True)
class Closure:
    """What a candidate does to held-out data.

    Parameters
    ----------
    whole : Share of all data
    channels : "field" and "load" → Share, of those that are there
    before, after : Distance over all held-out stages and points
    folds : fold's name → before, after; also field from load and load from field
    """

    whole: Share
    channels: Mapping[str, Share]
    before: Distance
    after: Distance
    folds: Mapping[str, tuple[Distance, Distance]]

    @property
    def fraction(self) -> float:
        return self.whole.fraction

    @property
    def nothing(self) -> bool:
        return self.whole.nothing


def folds(observation: Observation) -> tuple[list[Fold], list[Fold]]:
    """Folds by stage and by points, which together hold out every datum twice; and those from channel to channel."""
    o = observation
    s, p = o.sight.cmod.size, len(o.sight.points)
    station = np.concatenate([np.repeat(np.arange(s), 2 * p), np.arange(s)])[o.mask]
    point = np.concatenate([np.tile(np.repeat(np.arange(p), 2), s), np.full(s, -1)])[o.mask]
    order = np.empty(p, int)
    order[np.lexsort(o.sight.points.T)] = np.arange(p)  # by place, not by number
    within = []
    for k, stage in enumerate(STAGES):
        within.append(Fold(stage, o.sight.stage[station] == k))
    is_field = point >= 0
    for part in range(POINT_PARTS):
        within.append(Fold(f"points {part + 1}", is_field & (order[point] % POINT_PARTS == part)))
    across = [Fold(name, held) for name, held in zip(ACROSS, (~is_field, is_field), strict=True)]
    return [f for f in within if _usable(f)], [f for f in across if _usable(f)]


def _usable(fold: Fold) -> bool:
    return bool(fold.held.any() and np.count_nonzero(~fold.held) >= 6)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Differences of one candidate at data it was not fitted to, fold by fold.

    Parameters
    ----------
    differences : fold's name → (n,) array, NaN where not held out
    """

    differences: Mapping[str, np.ndarray]


def held_out(candidate: Candidate, data: Data, chosen: list[Fold], start: np.ndarray) -> HeldOut:
    """Fit a candidate without every fold in turn and predict it."""
    found = {}
    for fold in chosen:
        rest = ~fold.held
        part = replace(candidate, predict=_part(candidate.predict, rest), doubt=None)
        at, *_ = best_point(part, Data(data.target[rest], data.metric.part(rest), data.box), start)
        q = len(data.box)
        found[fold.name] = np.where(fold.held, data.target - candidate.predict(at[:q], at[q:]), np.nan)
    return HeldOut(found)


def _part(predict: Predict, keep: np.ndarray) -> Predict:
    return lambda parameters, amplitudes: predict(parameters, amplitudes)[keep]


def left_by_complete(
    candidate: Candidate, data: Data, chosen: list[Fold], at: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """What a model that lacks nothing leaves at data it was not fitted to: what closure is counted from.

    Draws of noise and discrepancy go through the same fits without every fold, linear about `at`; a parameter that the
    rest does not determine stays within its box.

    Parameters
    ----------
    candidate : Candidate without effects
    data, chosen : as of `held_out`
    at : (q,) array; its best parameters
    rng : numpy Generator

    Returns
    -------
    (folds, n, draws) array, in the units of the data, NaN where not held out
    """
    waves, step = data.metric.draws(DRAWS, rng), 1e-3 * data.width
    rows = [candidate.predict(at + h, np.zeros(0)) - candidate.predict(at - h, np.zeros(0)) for h in np.diag(step)]
    slopes = np.reshape(rows, (len(at), data.target.size)).T / 2e-3  # per width of the box
    found = np.full((len(chosen), *waves.shape), np.nan)
    for k, fold in enumerate(chosen):
        rest = ~fold.held
        white = data.metric.part(rest).white(np.hstack([slopes[rest], waves[rest]]))
        there, wave = white[:, : len(at)], white[:, len(at) :]
        moved = np.linalg.solve(there.T @ there + BOX_PRECISION * np.eye(len(at)), there.T @ wave)
        found[k, fold.held] = (waves - slopes @ moved)[fold.held]
    return found


def closure(
    observation: Observation,
    data: Data,
    none: HeldOut,
    candidate: HeldOut,
    complete: np.ndarray,
    rng: np.random.Generator,
) -> Closure:
    """Compare a candidate with the model as it is, both at held-out data.

    Parameters
    ----------
    observation : Observation
    data : Data of all that is there
    none, candidate : HeldOut
    complete : (folds, n, draws) array of `left_by_complete`; folds as of `none`, those from channel to channel left out
    rng : numpy Generator; of the bootstrap
    """
    std, is_field = data.metric.std, _is_field(observation)
    within = [n for n in none.differences if n not in ACROSS]
    before, after = (np.array([h.differences[n] for n in within]) / std for h in (none, candidate))
    block, waves = _blocks(observation), complete / std[:, None]
    channels = {"field": is_field, "load": ~is_field}
    table = {
        name: tuple(_distance(h.differences[name], std, is_field) for h in (none, candidate))
        for name in none.differences
    }
    return Closure(
        whole=_share(before, after, block, waves, rng),
        channels={
            name: _share(before[:, part], after[:, part], block[part], waves[:, part], rng)
            for name, part in channels.items()
            if np.isfinite(before[:, part]).any()
        },
        before=_distance(before * std, std, is_field),
        after=_distance(after * std, std, is_field),
        folds={name: (one, two) for name, (one, two) in table.items()},
    )


def _share(
    before: np.ndarray, after: np.ndarray, block: np.ndarray, waves: np.ndarray, rng: np.random.Generator
) -> Share:
    """What is closed of scaled differences (folds, n), against a complete model's (folds, n, draws)."""
    g0, g1 = _rms(before), _rms(after)
    floors = np.sqrt(np.nanmean(waves**2, axis=(0, 1)))
    floor = float(floors.mean())
    if g0 - floor < 2 * float(floors.std()):
        return Share(float("nan"), (float("nan"), float("nan")), g0, g1, floor, True)
    drawn = _bootstrap(before, after, np.unique(block, return_inverse=True)[1], floor, rng)
    return Share((g0 - g1) / (g0 - floor), drawn, g0, g1, floor, False)


def _rms(values: np.ndarray) -> float:
    known = np.isfinite(values)
    return float(np.sqrt(np.mean(values[known] ** 2))) if known.any() else float("nan")


def _distance(difference: np.ndarray, std: np.ndarray, is_field: np.ndarray) -> Distance:
    component = _rms(difference[..., is_field])
    return Distance(np.sqrt(2) * component / UM, _rms(difference[..., ~is_field]), _rms(difference / std))


def _is_field(observation: Observation) -> np.ndarray:
    size = observation.reading.field.size
    return (np.arange(observation.mask.size) < size)[observation.mask]


def _blocks(observation: Observation) -> np.ndarray:
    """Number of the block of every datum (n,): a point in a stage, or the load in a stage."""
    o = observation
    s, p = o.sight.cmod.size, len(o.sight.points)
    stage = np.concatenate([np.repeat(o.sight.stage, 2 * p), o.sight.stage])
    point = np.concatenate([np.tile(np.repeat(np.arange(p), 2), s), np.full(s, p)])
    return np.unique((stage * (p + 1) + point)[o.mask], return_inverse=True)[1]


def _bootstrap(
    before: np.ndarray, after: np.ndarray, block: np.ndarray, floor: float, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of the fraction when blocks are drawn again."""
    known = np.isfinite(before)
    count = block.max() + 1
    squares = [np.bincount(block, (np.where(known, v, 0.0) ** 2).sum(axis=0), count) for v in (before, after)]
    size = np.bincount(block, known.sum(axis=0), count)
    drawn = rng.multinomial(count, np.full(count, 1 / count), DRAWS)
    drawn = drawn[drawn @ size > 0]
    total = drawn @ size
    g0, g1 = (np.sqrt(drawn @ q / total) for q in squares)
    rooms = np.maximum(g0 - floor, 1e-12)
    low, high = np.quantile((g0 - g1) / rooms, [0.025, 0.975])
    return float(low), float(high)
