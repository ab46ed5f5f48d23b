"""Calibration of the probabilities: trials on specimens that the library has not seen, with effects of random size."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.core.errors import InputError, PipelineError
from pipeline.core.units import MM
from pipeline.execution.progress import Progress, Silent
from pipeline.gap.calibration import Answer, Calibration, calibrated, expected_error
from pipeline.gap.effects import effect
from pipeline.gap.library import Entry, nearest, parse
from pipeline.study.gap_library import write_entry
from pipeline.study.gap_trials import Bench, Trial

SIZES = (0.5, 4.0)  # times the detection limit, log-uniform, at most the plausible maximum

log = logging.getLogger("pipeline.study")


def calibrate(
    out: Path,
    file: Path,
    *,
    seeds: Sequence[int],
    effects: int = 4,
    geometry: str = "seb",
    radius_mm: float = 1.0,
    progress: Progress | None = None,
) -> str:
    """Make trials, fit the temperature, write it into the library; goes on where it stopped.

    Parameters
    ----------
    out : folder of the trials
    file : library
    seeds : of the specimens, none of the library's
    effects : int; tests with an effect for every specimen, beside one without
    geometry, radius_mm : of the tests

    Raises
    ------
    InputError
        for seeds that the library was learnt from, or too few
    """
    progress = progress or Silent()
    entry = entry_of(file, geometry, radius_mm)
    first, last = entry.seeds
    if any(first <= seed <= last for seed in seeds):
        raise InputError(f"seeds {first} to {last} made the library: calibrate with others")
    trials: list[Trial] = []
    for seed in seeds:
        progress.stage(f"trials of seed {seed}")
        bench = Bench(out / f"{geometry}-{radius_mm:g}-{seed:04d}", seed, radius_mm, geometry, entry)
        trials += specimen_trials(bench, effects)
    answers = [answer(t) for t in trials]
    if len({a.group for a in answers}) < 2:
        raise InputError("a temperature needs trials of at least two specimens")
    found = calibrated(answers)
    write_entry(file, replace(entry, temperature=found.temperature, tests=found.tests))
    return told(found, answers)


def told(found: Calibration, answers: Sequence[Answer]) -> str:
    """One sentence on a calibration."""
    return (
        f"temperature {found.temperature:.3g} from {found.tests} tests; mean log score {found.log_score:.3f}, "
        f"{found.cross:.3f} across specimens, {found.cold:.3f} at a temperature of one; expected calibration error "
        f"{expected_error(answers, found.temperature):.2f}, {expected_error(answers, 1.0):.2f} at one"
    )


def entry_of(file: Path, geometry: str, radius_mm: float) -> Entry:
    """The entry of a library for a geometry and radius."""
    return nearest(parse(json.loads(file.read_text("utf-8"))), geometry, radius_mm * MM)


def answer(trial: Trial) -> Answer:
    """A trial as the calibration sees it."""
    return Answer(trial.seed, trial.label, trial.log_bayes, trial.tested)


def specimen_trials(bench: Bench, effects: int) -> list[Trial]:
    """One test without an effect and so many with, of different effects and random size."""
    found: list[Trial] = []
    try:
        free = bench.trial({})
        found.append(free)
        for name, value in drawn(free.limits, effects, np.random.default_rng(bench.seed)):
            found.append(bench.trial({name: value}))
    except PipelineError as error:
        log.warning("a trial of seed %d is left out: %s", bench.seed, error)
    return found


def drawn(limits: Mapping[str, float | None], count: int, rng: np.random.Generator) -> list[tuple[str, float]]:
    """Effects and sizes by chance, from detection limits (None: there is none; then up to the plausible maximum)."""
    names = sorted(limits)
    chosen = rng.choice(len(names), size=min(count, len(names)), replace=False)
    factors = SIZES[0] * (SIZES[1] / SIZES[0]) ** rng.uniform(size=len(chosen))
    signs = rng.choice([-1.0, 1.0], size=len(chosen))
    return [(names[i], sized(names[i], limits[names[i]], f, s)) for i, f, s in zip(chosen, factors, signs, strict=True)]


def sized(name: str, limit: float | None, factor: float, sign: float = 1.0) -> float:
    """So many detection limits of an effect, to three digits and at most as much as is plausible either way."""
    size = effect(name).magnitude
    most = size.high if sign > 0 or size.low == 0 else -size.low
    value = min(factor * (most if limit is None else limit), most)
    return float(f"{value if size.low == 0 else sign * value:.3g}")
