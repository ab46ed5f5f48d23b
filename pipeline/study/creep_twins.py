"""Creeping virtual tests on the irregular network, identified with and without creep."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.execution.progress import Progress, Silent
from pipeline.store.atomic import write_atomically
from pipeline.store.creep import CreepRecord, encode_creep
from pipeline.store.results import read_result
from pipeline.study.creep_trials import MASTIC, READINGS
from pipeline.study.identify import identify
from pipeline.study.trials import Trial, compare, worst
from pipeline.study.truth import made_already
from pipeline.study.virtual_test import virtual_test

NOT_FITTED = ("", "", "", "")  # cells


@dataclass(frozen=True)
class CreepTwin:
    """One creeping virtual test and what the fit with creep, and the one without where it was asked for, make of it."""

    name: str
    viscoelastic: Trial
    elastic: Trial | None


def creep_twins(
    folder: Path,
    geometries: Iterable[str],
    seeds: Sequence[int],
    *,
    radius_mm: float,
    objective: str = "both",
    engine: str = "lammps",
    elastic: bool = True,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Iterator[CreepTwin]:
    """Break creeping specimens on irregular networks and identify them; a second call goes on.

    Network, lattice and engine of the fit are not those of the truth, as in the trials without creep.

    Parameters
    ----------
    folder : where bundles and results are kept
    geometries : of "seb", "dct"
    seeds : of section, network, truth and noise
    radius_mm : of the identifying lattice
    objective, engine, workers : as of `identify`
    elastic : whether to fit without creep, too
    """
    told = progress or Silent()
    folder.mkdir(parents=True, exist_ok=True)
    sheet = folder / "creep.csv"
    write_atomically(sheet, encode_creep(CreepRecord(READINGS, MASTIC.creep_compliance(READINGS))))
    for geometry in geometries:
        for seed in seeds:
            bundle = folder / f"{geometry}-{seed}"
            if not made_already(bundle):
                virtual_test(bundle, seed=seed, geometry=geometry, radius_mm=radius_mm, creep=sheet, progress=told)
            truth, found = json.loads((bundle / "truth.json").read_text("utf-8")), []
            for creeps in (True, False) if elastic else (True,):
                out = folder / f"{bundle.name}-{objective}-{'viscoelastic' if creeps else 'elastic'}"
                identify(
                    bundle,
                    out,
                    objective=objective,
                    engine=engine,
                    viscoelastic=creeps or None,
                    workers=workers,
                    progress=told,
                )
                found.append(compare(f"{geometry}, seed {seed}", truth, read_result(out)))
            yield CreepTwin(found[0].name, found[0], found[1] if elastic else None)


def twin_table(twins: Sequence[CreepTwin]) -> str:
    """Trials as a Markdown table; medians, the worst and how many intervals hold the truth at each geometry's foot."""
    head = ([f"{fit}: f_max", "delta_max", "G_f", "truth in interval"] for fit in ("viscoelastic", "elastic"))
    rows = [_row("test", head), "|---|" + 8 * "---|"]
    rows += [_row(one.name, (_fit(one.viscoelastic), _fit(one.elastic))) for one in twins]
    for geometry in dict.fromkeys(one.name.split(",")[0] for one in twins):
        group = [one for one in twins if one.name.startswith(f"{geometry},")]
        feet = [_foot([one.viscoelastic for one in group]), _foot([one.elastic for one in group])]
        for name, *cells in zip(("median", "worst", "truth inside"), *feet, strict=True):
            rows.append(_row(f"**{name}, {geometry}**", cells))
    return "\n".join(rows) + "\n"


def _row(name: str, fits: Iterable[Sequence[str]]) -> str:
    cells = [name, *(cell for fit in fits for cell in fit)]
    return "|" + "".join(f" {cell} |" if cell else " |" for cell in cells)


def _fit(trial: Trial | None) -> Sequence[str]:
    """The four cells of one fit."""
    if trial is None:
        return NOT_FITTED
    return [*_told(_ratios(trial)), ", ".join("yes" if yes else "no" for yes in (trial.inside_f, trial.inside_delta))]


def _foot(trials: Sequence[Trial | None]) -> Sequence[Sequence[str]]:
    """The four cells of the median, of the worst and of how many hold the truth, of those that were fitted."""
    fitted = [trial for trial in trials if trial is not None]
    if not fitted:
        return 3 * [NOT_FITTED]
    ratios = np.array([_ratios(trial) for trial in fitted])
    inside = [f"{sum(getattr(t, k) for t in fitted)} of {len(fitted)}" for k in ("inside_f", "inside_delta")]
    return [[*_told(np.median(ratios, axis=0)), ""], [*_told(worst(ratios)), ""], [*inside, "", ""]]


def _ratios(trial: Trial) -> tuple[float, float, float]:
    return trial.f_max, trial.delta_max, trial.energy


def _told(ratios: Iterable[float]) -> list[str]:
    return [f"{ratio - 1:+.1%}" for ratio in ratios]
