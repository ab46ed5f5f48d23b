"""The only causal test: what explains some tests is taken to another one that had no part in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.errors import ConvergenceError
from pipeline.gap.candidate import Candidate
from pipeline.gap.closure import Closure, closure, folds, held_out, left_by_complete
from pipeline.gap.diagnosis import Diagnosis, Run, Simulate
from pipeline.gap.effect import PhysicsEffect
from pipeline.gap.effects import effect
from pipeline.gap.emulator import Emulator
from pipeline.gap.fit import Fitted
from pipeline.gap.score import NONE, names_of

REPLICATE, OTHER = "replicate", "other condition"


@dataclass(frozen=True, eq=False)
class Test:
    """One diagnosed test among several.

    Parameters
    ----------
    name : str
    diagnosis : Diagnosis
    area : float, m²; f_max over it is a traction that all tests of a material share
    condition : what replicates have in common: geometry, CMOD rate (m/s, or None), temperature
    simulate : Simulate; of this test
    """

    __test__ = False  # no test of pytest's

    name: str
    diagnosis: Diagnosis
    area: float
    condition: tuple[str, float | None, float | None]
    simulate: Simulate

    def strength_ratio(self, source: Test, found: Fitted) -> float:
        """f_max here over that of another test, of what was fitted there: of the areas, and of the rates by effects."""
        ratio, mine, theirs = self.area / source.area, self.condition[1], source.condition[1]
        for name, value in zip(_owners(found.candidate), found.amplitudes, strict=True):
            one = effect(name)
            if isinstance(one, PhysicsEffect) and mine and theirs:
                ratio *= one.strength_ratio(float(value), mine / theirs)
        return ratio


@dataclass(frozen=True, eq=False)
class Transfer:
    """An explanation that was fitted to some tests and judged by another.

    Parameters
    ----------
    label : str
    target : str; the test that judges
    sources : tuple of str
    kind : REPLICATE or OTHER
    carried : effects whose size comes from the sources, as (f_max, δ_max) do
    refitted : effects whose size is the target's own, fitted to the parts of it that are not judged
    closure : Closure of the target, against the model as it is with the parameters that it has in the sources
    """

    label: str
    target: str
    sources: tuple[str, ...]
    kind: str
    carried: tuple[str, ...]
    refitted: tuple[str, ...]
    closure: Closure


def transfers(tests: Sequence[Test], labels: Sequence[str], rng: np.random.Generator) -> list[Transfer]:
    """Take explanations to every test from its replicates, and from tests under other conditions.

    Parameters
    ----------
    tests : two or more
    labels : explanations, none not among them
    rng : numpy Generator; of bootstrap and floor
    """
    found = []
    for target in tests:
        others = [t for t in tests if t is not target]
        for kind in (REPLICATE, OTHER):
            sources = [t for t in others if (t.condition == target.condition) == (kind == REPLICATE)]
            if sources:
                found += _to(target, sources, kind, labels, rng.spawn(1)[0])
    return found


def _to(
    target: Test, sources: Sequence[Test], kind: str, labels: Sequence[str], rng: np.random.Generator
) -> list[Transfer]:
    d = target.diagnosis
    within, _ = folds(d.observation)
    if not within:
        return []
    fixed = replace(d.data, box=np.zeros((0, 2)))
    start = np.zeros(0)
    none = _carried(target, sources, kind, NONE)
    if none is None:
        return []
    left = held_out(none, fixed, within, start)
    complete = left_by_complete(none, fixed, within, start, rng)
    found = []
    for label in labels:
        candidate = _carried(target, sources, kind, label)
        if candidate is None:
            continue
        judged = closure(
            d.observation, d.data, left, held_out(candidate, fixed, within, start), complete, rng.spawn(1)[0]
        )
        names = names_of(label)
        carried = tuple(n for n in names if _carries(n, kind))
        refitted = tuple(n for n in names if n not in carried)
        found.append(Transfer(label, target.name, tuple(s.name for s in sources), kind, carried, refitted, judged))
    return found


def _owners(candidate: Candidate) -> list[str]:
    """The effect of every amplitude."""
    return [n for n, m in zip(candidate.names, candidate.magnitudes, strict=True) for _ in range(m.directions)]


def _carries(name: str, kind: str) -> bool:
    """Whether an effect is as large in the target as in the sources."""
    belongs = effect(name).belongs
    return belongs == "material" or (belongs == "set-up" and kind == REPLICATE)


def _carried(target: Test, sources: Sequence[Test], kind: str, label: str) -> Candidate | None:
    """The explanation with parameters and carried effects of the sources; the rest is left to be fitted.

    None where the target cannot be simulated there.
    """
    d, fits = target.diagnosis, [s.diagnosis.fits[label] for s in sources]
    scale = [np.array([target.strength_ratio(s, f), 1.0]) for s, f in zip(sources, fits, strict=True)]
    parameters = np.median([f.parameters * x for f, x in zip(fits, scale, strict=True)], axis=0)
    size = np.median([f.amplitudes for f in fits], axis=0)
    whole = fits[0].candidate
    owner = _owners(whole)
    open_ = np.array([not _carries(n, kind) for n in owner], bool)
    physics = {
        n: float(a) for n, a in zip(owner, size, strict=True) if effect(n).kind == "physics" and _carries(n, kind)
    }
    try:
        emulator = _reaching(target, parameters, physics)
    except ConvergenceError:
        return None
    told = emulator.unloaded().candidate(whole.names, d.observation.mask)
    names = tuple(n for n in whole.names if not _carries(n, kind))
    sizes = tuple(m for n, m in zip(whole.names, whole.magnitudes, strict=True) if n in names)

    def predict(_: np.ndarray, free: np.ndarray) -> np.ndarray:
        amplitudes = size.copy()
        amplitudes[open_] = free
        return told.predict(parameters, amplitudes)

    return Candidate(names, sizes, predict)


def _reaching(target: Test, parameters: np.ndarray, physics: Mapping[str, float]) -> Emulator:
    """The target's emulator; beyond its grid simulated at the very point.

    Raises
    ------
    ConvergenceError
        where there is no such simulation
    """
    emulator = target.diagnosis.emulator
    if np.all((parameters >= emulator.box[:, 0]) & (parameters <= emulator.box[:, 1])):
        return emulator
    at = (float(parameters[0]), float(parameters[1]))
    runs = [Run(*at), *(Run(*at, ((name, value),)) for name, value in sorted(physics.items()) if value != 0)]
    outcomes = target.simulate(runs)
    for run, outcome in zip(runs, outcomes, strict=True):
        if isinstance(outcome, str):
            raise ConvergenceError(outcome)
        if run.effects:
            [(name, value)] = run.effects
            if emulator.signatures[name].large(value):
                emulator = emulator.with_confirmed(name, value, parameters, outcome.flat())
        else:
            emulator = emulator.confirmed(parameters, outcome.flat())
    return emulator
