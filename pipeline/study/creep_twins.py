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
from pipeline.study.trials import Trial, compare
from pipeline.study.virtual_test import virtual_test


@dataclass(frozen=True)
class CreepTwin:
    """One creeping virtual test and what both fits make of it."""

    name: str
    viscoelastic: Trial
    elastic: Trial


def creep_twins(
    folder: Path,
    geometries: Iterable[str],
    seeds: Sequence[int],
    *,
    radius_mm: float,
    objective: str = "both",
    engine: str = "lammps",
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
    """
    told = progress or Silent()
    folder.mkdir(parents=True, exist_ok=True)
    sheet = folder / "creep.csv"
    write_atomically(sheet, encode_creep(CreepRecord(READINGS, MASTIC.creep_compliance(READINGS))))
    for geometry in geometries:
        for seed in seeds:
            bundle = folder / f"{geometry}-{seed}"
            if not (bundle / "truth.json").is_file():
                virtual_test(bundle, seed=seed, geometry=geometry, radius_mm=radius_mm, creep=sheet, progress=told)
            truth, found = json.loads((bundle / "truth.json").read_text("utf-8")), []
            for creeps in (True, False):
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
            yield CreepTwin(found[0].name, *found)


def twin_table(twins: Sequence[CreepTwin]) -> str:
    """Trials as a Markdown table, the medians and the worst of each geometry at its foot."""
    what = "f_max | delta_max | G_f | truth in interval"
    rows = [f"| test | viscoelastic: {what} | elastic: {what} |", "|---|" + 8 * "---|"]
    for one in twins:
        rows.append(f"| {one.name} | {_fit(one.viscoelastic)} | {_fit(one.elastic)} |")
    for geometry in dict.fromkeys(one.name.split(",")[0] for one in twins):
        group = [one for one in twins if one.name.startswith(f"{geometry},")]
        off = np.array([[_off(one.viscoelastic), _off(one.elastic)] for one in group])
        worst = np.take_along_axis(off, np.abs(off).argmax(axis=0)[None], axis=0)[0]
        for name, values in (("median", np.median(off, axis=0)), ("worst", worst)):
            rows.append(f"| **{name}, {geometry}** | {_told(values[0])} | | {_told(values[1])} | |")
    return "\n".join(rows) + "\n"


def _off(trial: Trial) -> list[float]:
    return [trial.f_max - 1, trial.delta_max - 1, trial.energy - 1]


def _told(values: Sequence[float] | np.ndarray) -> str:
    return " | ".join(f"{value:+.1%}" for value in values)


def _fit(trial: Trial) -> str:
    inside = ", ".join("yes" if yes else "no" for yes in (trial.inside_f, trial.inside_delta))
    return f"{_told(_off(trial))} | {inside}"
