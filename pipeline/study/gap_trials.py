"""Trials of the diagnosis: virtual tests of engine B with effects of chosen size, diagnosed one after the other."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config import RunSettings
from pipeline.core.errors import InputError, PipelineError
from pipeline.core.units import MM
from pipeline.execution.here import Here
from pipeline.execution.progress import Silent
from pipeline.gap.diagnosis import Diagnosis, diagnose
from pipeline.gap.effects import library
from pipeline.gap.library import Entry, parse
from pipeline.gap.score import NONE
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import read_bundle
from pipeline.store.results import plain
from pipeline.store.start import start_parameters
from pipeline.study.batch import Batch
from pipeline.study.diagnose_case import ENGINE, Case, prepared
from pipeline.study.diagnose_result import estimate
from pipeline.study.diagnose_sight import seen
from pipeline.study.effects import Band

FACTORS = (0.7, 0.95, 1.3)  # of the start, for f_max and delta_max
NEAR = 1.5 * MM  # paths so near are one: tests of one specimen then share their simulations

log = logging.getLogger("pipeline.study")


@dataclass(frozen=True)
class Trial:
    """One diagnosed test.

    Parameters
    ----------
    seed : int; of the specimen
    effects : what was put in, by name
    without : effects taken out of the library
    verdict : str
    named : effects named
    log_bayes : label → log Bayes factor
    tested : int; effects
    gate : str; the mode that fails, "" where none does
    estimates : effect → value, low, high (95 %), if it is the only one
    limits : effect → detection limit, None: none
    closure : of the first explanation and its 95 % interval, or None
    parameters : identified over true, before and after
    runs : int; simulations asked for
    """

    seed: int
    effects: Mapping[str, float]
    without: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    log_bayes: Mapping[str, float]
    tested: int
    gate: str
    estimates: Mapping[str, tuple[float, float, float]]
    limits: Mapping[str, float | None]
    classes: tuple[tuple[str, ...], ...]
    closure: tuple[float, float, float] | None
    parameters: tuple[float, float, float, float]
    runs: int

    @property
    def label(self) -> str:
        """The right answer, as `log_bayes` calls it."""
        return " + ".join(sorted(self.effects)) or NONE


def unseen(batch: Batch, file: Path, seeds: Sequence[int]) -> list[Bench]:
    """A bench a seed, judged by the entry of a library that has not seen the specimens.

    Raises
    ------
    InputError
        for seeds that the library was learnt from
    """
    entry = batch.entry(parse(json.loads(file.read_text("utf-8"))))
    first, last = entry.seeds
    if any(first <= seed <= last for seed in seeds):
        raise InputError(f"seeds {first} to {last} made the library: take others")
    return [Bench(batch, seed, entry) for seed in seeds]


@dataclass(frozen=True, eq=False)
class Bench:
    """One specimen on which trials are made; those whose cracks agree share their simulations.

    Parameters
    ----------
    batch : Batch of the specimen
    seed : int
    entry : Entry to judge by
    """

    batch: Batch
    seed: int
    entry: Entry

    @property
    def folder(self) -> Path:
        """Of all trials on the specimen."""
        return self.batch.folder(self.seed)

    def tried(self, effects: Mapping[str, float], without: tuple[str, ...] = (), closed: int = 0) -> list[Trial]:
        """The trial; none where it cannot be simulated."""
        try:
            return [self.trial(effects, without, closed)]
        except PipelineError as error:
            log.warning("left out: seed %d, %s: %s", self.seed, dict(effects) or NONE, error)
            return []

    def trial(self, effects: Mapping[str, float], without: tuple[str, ...] = (), closed: int = 0) -> Trial:
        """Make a test, diagnose it; found again where it was made before.

        Raises
        ------
        PipelineError
            where test or baseline cannot be simulated
        """
        name = "-".join(f"{n}={v:.4g}" for n, v in sorted(effects.items())) or "nothing"
        file = self.folder / f"{name}{''.join('-without-' + w for w in without)}.json"
        if file.exists():
            return read_trial(file)
        found = self._made(name, dict(effects), without, closed)
        write_atomically(file, (json.dumps(plain(asdict(found)), indent=1) + "\n").encode())
        return found

    def _made(self, name: str, effects: dict[str, float], without: tuple[str, ...], closed: int) -> Trial:
        bundle = self.folder / "tests" / name
        self.batch.make(bundle, self.seed, effects)
        truth = json.loads((bundle / "truth.json").read_text("utf-8"))
        case = self._case(bundle)
        names = [n for n in library() if n not in without]
        found = diagnose(
            case.look.observation, case.look.abscissae, case.simulator, start_parameters(case.bundle), self.entry,
            np.random.default_rng(self.seed), names, FACTORS, closed,
        )  # fmt: skip
        return trial_of(found, self.seed, effects, without, (truth["f_max_n"], truth["delta_max_m"]))

    def _case(self, bundle: Path) -> Case:
        """The test prepared; with the strip and the stations of the test without effects where they do as well."""
        case = _quick(prepared(read_bundle(bundle), self.folder, ENGINE, RunSettings(workers=1), Silent()))
        first = self.folder / "tests" / "nothing"
        if bundle == first or not first.exists():
            return case
        usual = seen(read_bundle(first))
        look, band = case.look, case.band
        if usual.path is not None and case.look.path is not None and _apart(usual.path, case.look.path) < NEAR:
            band = Band(usual.path, band.half)  # which points lie too near the crack, its own path says
        if look.observation.sight.cmod[-1] <= usual.abscissae.field[-1]:
            look = replace(look, abscissae=usual.abscissae)
        simulator = replace(case.simulator, band=band, abscissae=look.abscissae)
        return replace(case, look=look, band=band, simulator=simulator)


def _quick(case: Case) -> Case:
    return replace(case, simulator=replace(case.simulator, executor=Here()))


def _apart(one: np.ndarray, two: np.ndarray) -> float:
    """The farthest (m) that two paths lie apart at heights that both have."""
    low, high = max(one[0, 1], two[0, 1]), min(one[-1, 1], two[-1, 1])
    height = np.linspace(low, high, 40)
    across = [np.interp(height, *path[np.argsort(path[:, 1], kind="stable")][:, ::-1].T) for path in (one, two)]
    return float(np.abs(across[0] - across[1]).max())


def trial_of(
    d: Diagnosis, seed: int, effects: dict[str, float], without: tuple[str, ...], truth: tuple[float, float]
) -> Trial:
    """What is kept of a diagnosis."""
    first = d.scored.causes()[0]
    closure = d.closures.get(first)
    singles = [n for n in d.card.names if n in d.fits]
    estimates = {n: estimate(d, n) for n in singles}
    before, after = d.fits[NONE].parameters / truth, d.best.parameters / truth
    limits = {n: float(x) if np.isfinite(x) else None for n, x in zip(d.card.names, d.card.limit, strict=True)}
    return Trial(
        seed=seed,
        effects=effects,
        without=without,
        verdict=d.verdict.kind,
        named=d.verdict.named,
        log_bayes=dict(d.scored.log_bayes),
        tested=len(d.card.names),
        gate=d.gate.failed[0] if d.gate.failed else "",
        estimates={n: (e["value"], *e["interval_95"]) for n, e in estimates.items()},
        limits=limits,
        classes=d.card.classes,
        closure=None if closure is None or closure.nothing else (closure.fraction, *closure.whole.interval),
        parameters=(before[0], before[1], after[0], after[1]),
        runs=d.runs,
    )


def read_trial(file: Path) -> Trial:
    """A trial that was kept."""
    raw: dict[str, Any] = json.loads(file.read_text("utf-8"))
    for key in ("without", "named", "parameters"):
        raw[key] = tuple(raw[key])
    raw["classes"] = tuple(tuple(c) for c in raw["classes"])
    raw["estimates"] = {n: tuple(v) for n, v in raw["estimates"].items()}
    raw["closure"] = None if raw["closure"] is None else tuple(raw["closure"])
    return Trial(**raw)
