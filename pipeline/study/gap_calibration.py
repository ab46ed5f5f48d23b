"""Calibration of the probabilities: trials on specimens that the library has not seen, with effects of random size.

A material is of no kind that a library has met. So every specimen is judged by an entry that was learnt on networks of
the other kind: where its bonds carry shear on those that carry none, and the other way round. What ships is learnt on
both; how sure it may be of something new is measured so. (What creeps or depends on the rate carries no shear in either
half: these few tests are of a kind that was met.)
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.core.errors import InputError
from pipeline.gap.calibration import Answer, Calibration, calibrated, expected_error
from pipeline.gap.effects import effect
from pipeline.gap.library import parse
from pipeline.study.batch import Batch
from pipeline.study.gap_library import UNMET, same, write_entry
from pipeline.study.gap_trials import Bench, Trial, unseen

SIZES = (0.15, 1.0)  # of the plausible maximum, log-uniform


def calibrate(batch: Batch, file: Path, learnt: Path, seeds: Sequence[int], effects: int = 6) -> str:
    """Make trials, fit the temperature, write it into the library; goes on where it stopped.

    Parameters
    ----------
    file : library
    learnt : folder that the library was made in, with the entries of either kind
    seeds : of the specimens, none of the library's
    effects : tests with an effect for every specimen, beside one without

    Raises
    ------
    InputError
        for seeds that the library was learnt from, or too few
    """
    batch = batch.with_creep()
    benches = [bench for seed in seeds for bench in unseen(batch, learnt / UNMET[batch.slides(seed)], [seed])]
    trials: list[Trial] = []
    for bench in benches:
        batch.progress.stage(f"trials of seed {bench.seed}")
        trials += specimen_trials(bench, effects)
    answers = [answer(t) for t in trials]
    if len({a.group for a in answers}) < 2:
        raise InputError("a temperature needs trials of at least two specimens")
    found = calibrated(answers)
    entries = parse(json.loads(file.read_text("utf-8")))
    entry = next(e for e in entries if same(e.domain, batch.entry(entries).domain))  # as it was learnt
    write_entry(file, replace(entry, temperature=found.temperature, tests=found.tests))
    return told(found, answers)


def told(found: Calibration, answers: Sequence[Answer]) -> str:
    """One sentence on a calibration."""
    return (
        f"temperature {found.temperature:.3g} from {found.tests} tests; mean log score {found.log_score:.3f}, "
        f"{found.cross:.3f} across specimens, {found.cold:.3f} at a temperature of one; expected calibration error "
        f"{expected_error(answers, found.temperature):.2f}, {expected_error(answers, 1.0):.2f} at one"
    )


def answer(trial: Trial) -> Answer:
    """A trial as the calibration sees it."""
    return Answer(trial.seed, trial.label, trial.log_bayes, trial.tested)


def specimen_trials(bench: Bench, effects: int) -> list[Trial]:
    """One test without an effect and so many with, of different effects and random size."""
    found = bench.tried({})
    if not found:
        return []
    for name, value in drawn(found[0].limits, effects, np.random.default_rng(bench.seed)):
        found += bench.tried({name: value})
    return found


def drawn(names: Collection[str], count: int, rng: np.random.Generator) -> list[tuple[str, float]]:
    """Effects and sizes by chance: `SIZES` of the plausible maximum, log-uniform, either way.

    Not of detection limits: these depend on the temperature that is sought.
    """
    found = []
    for name in rng.choice(sorted(names), size=min(count, len(names)), replace=False):
        size = effect(name).magnitude
        value = size.high * SIZES[0] * (SIZES[1] / SIZES[0]) ** rng.uniform()
        if size.low < 0 and rng.uniform() < 0.5:
            value = -value
        found.append((str(name), float(f"{value:.3g}")))
    return found


def sized(name: str, limit: float | None, factor: float, sign: float = 1.0) -> float:
    """So many detection limits of an effect, to three digits and at most as much as is plausible either way."""
    size = effect(name).magnitude
    most = size.high if sign > 0 or size.low == 0 else -size.low
    value = min(factor * (most if limit is None else limit), most)
    return float(f"{value if size.low == 0 else sign * value:.3g}")
