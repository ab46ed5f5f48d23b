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
class Closure:
    """What a candidate does to held-out data.

    Parameters
    ----------
    fraction : float; (g₀ − g₁)/(g₀ − g_floor), NaN where there is nothing to close
    interval : (low, high), 95 %, block bootstrap
    before, after : Distance over all held-out stages and points
    floor : float; what noise and discrepancy alone leave, scaled
    nothing : bool; g₀ is within two standard deviations of the floor
    folds : fold's name → before, after; also field from load and load from field
    """

    fraction: float
    interval: tuple[float, float]
    before: Distance
    after: Distance
    floor: float
    nothing: bool
    folds: Mapping[str, tuple[Distance, Distance]]


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
    across = [Fold("load from field", ~is_field), Fold("field from load", is_field)]
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
        part = replace(candidate, predict=_part(candidate.predict, rest))
        at, *_ = best_point(part, Data(data.target[rest], data.metric.part(rest), data.box), start)
        q = len(data.box)
        found[fold.name] = np.where(fold.held, data.target - candidate.predict(at[:q], at[q:]), np.nan)
    return HeldOut(found)


def _part(predict: Predict, keep: np.ndarray) -> Predict:
    return lambda parameters, amplitudes: predict(parameters, amplitudes)[keep]


def closure(
    observation: Observation, data: Data, none: HeldOut, candidate: HeldOut, rng: np.random.Generator
) -> Closure:
    """Compare a candidate with the model as it is, both at held-out data.

    Parameters
    ----------
    observation : Observation
    data : Data of all that is there
    none, candidate : HeldOut
    rng : numpy Generator; of bootstrap and floor
    """
    std, is_field = data.metric.std, _is_field(observation)
    within = [n for n in none.differences if n not in ("load from field", "field from load")]
    before, after = (np.array([h.differences[n] for n in within]) / std for h in (none, candidate))
    block = _blocks(observation)
    g0, g1 = _rms(before), _rms(after)
    floors = _floors(data, rng)
    floor, spread = float(floors.mean()), float(floors.std())
    nothing = bool(g0 - floor < 2 * spread)
    low, high = _bootstrap(before, after, block, floor, rng)
    table = {
        name: tuple(_distance(h.differences[name], std, is_field) for h in (none, candidate))
        for name in none.differences
    }
    return Closure(
        fraction=float("nan") if nothing else (g0 - g1) / (g0 - floor),
        interval=(float("nan"), float("nan")) if nothing else (low, high),
        before=_distance(before * std, std, is_field),
        after=_distance(after * std, std, is_field),
        floor=floor,
        nothing=nothing,
        folds={name: (one, two) for name, (one, two) in table.items()},
    )


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


def _floors(data: Data, rng: np.random.Generator) -> np.ndarray:
    """Scaled distance of a model that lacks nothing, `DRAWS` times."""
    root = np.linalg.cholesky(data.metric.covariance)
    waves = root @ rng.standard_normal((len(root), DRAWS)) / data.metric.std[:, None]
    return np.sqrt(np.mean(waves**2, axis=0))


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
