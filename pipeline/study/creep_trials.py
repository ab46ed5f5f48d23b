"""Trials with creep in the truth: what an elastic fit makes of it, and whether a viscoelastic one finds the truth."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.units import GPA, MM
from pipeline.execution.progress import Progress, Silent
from pipeline.materials.burgers import Burgers
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import read_bundle
from pipeline.store.creep import CreepRecord
from pipeline.store.new import Contents, write_bundle
from pipeline.store.results import read_result
from pipeline.study.assembly import CREEPING, build_model
from pipeline.study.engines import engine as engine_of
from pipeline.study.filming import Clock
from pipeline.study.identify import identify
from pipeline.study.request import Request
from pipeline.study.truth import draw_truth
from pipeline.study.virtual_test import prepare, recording_of, with_noise
from pipeline.twin.virtual_test import exact_record, noisy_record

MASTIC = Burgers(0.1 / GPA, 0.04 / GPA, 1500 * GPA, 15.0)
"""1/D₁ is the bundle's modulus of 10 GPa; the compliance grows by 15 % in 5 s and by 79 % in 60 s."""

READINGS = np.geomspace(0.5, 1000.0, 50)  # s


@dataclass(frozen=True)
class CreepTrial:
    """Estimates over truth of one creeping specimen.

    Parameters
    ----------
    name : str
    elastic, viscoelastic : (f_max, delta_max) over the truth
    inside : whether the viscoelastic intervals of f_max and delta_max hold the truth
    paper_shift : f_max of the elastic over that of the viscoelastic fit, both by the paper's multinomial; NaN where one
        of its minima lies on the edge of the grid
    """

    name: str
    elastic: tuple[float, float]
    viscoelastic: tuple[float, float]
    inside: tuple[bool, bool]
    paper_shift: float

    @property
    def shift(self) -> float:
        """f_max of the elastic over that of the viscoelastic fit"""
        return self.elastic[0] / self.viscoelastic[0]


def creep_trials(
    folder: Path,
    geometries: Iterable[str],
    seeds: Sequence[int],
    *,
    radius_mm: float,
    objective: str = "fields",
    engine: str = "lammps",
    faster: float = 1.0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[CreepTrial]:
    """Break creeping specimens on the identifying lattice and fit them with and without creep; a second call goes on.

    The truth shares lattice and engine with the fit: what differs between the two fits is creep alone.

    Parameters
    ----------
    folder : where bundles and results are kept
    geometries : of "seb", "dct"
    seeds : of section, truth and noise
    radius_mm : of the particles
    objective, workers : as of `identify`
    engine : of the test and of the fit
    faster : factor on the usual rate of opening
    """
    told = progress or Silent()
    found = []
    for geometry in geometries:
        for seed in seeds:
            name = f"{geometry}-{seed}-{engine}" + (f"-faster-{faster:g}" if faster != 1 else "")
            if not (folder / name / "truth.json").is_file():
                asked = Request(geometry=geometry, radius_mm=radius_mm)
                creeping_test(folder / name, asked, seed, told, engine, faster)
            truth = json.loads((folder / name / "truth.json").read_text("utf-8"))
            results = []
            for creeps in (False, True):
                out = folder / f"{name}-{objective}-{'viscoelastic' if creeps else 'elastic'}"
                identify(
                    folder / name,
                    out,
                    objective=objective,
                    engine=engine,
                    placements=0,
                    viscoelastic=creeps or None,
                    workers=workers,
                    progress=told,
                )
                results.append(read_result(out))
            ratios = [tuple(float(r[key] / truth[key]) for key in ("f_max_n", "delta_max_m")) for r in results]
            interval = results[1]["interval_95"] or {"f_max_n": (1, 0), "delta_max_m": (1, 0)}
            inside = tuple(bool(interval[k][0] <= truth[k] <= interval[k][1]) for k in ("f_max_n", "delta_max_m"))
            papers = [r["paper"] for r in results]
            shift = papers[0]["f_max_n"] / papers[1]["f_max_n"] if all(p["interior"] for p in papers) else np.nan
            found.append(CreepTrial(f"{geometry}, seed {seed}", ratios[0], ratios[1], inside, shift))  # type: ignore[arg-type]
    return found


def creeping_test(
    out: Path, request: Request, seed: int, progress: Progress, engine: str = "lammps", faster: float = 1.0
) -> None:
    """A bundle of the identifying lattice whose mastic crept, in the time that the record states.

    Parameters
    ----------
    out : of the bundle
    request : Request
    seed : of section, truth and noise
    progress : Progress
    engine : that breaks it
    faster : factor on the usual rate of opening
    """
    of_section, of_truth, of_noise = np.random.default_rng(seed).spawn(3)
    experiment, images = prepare(request, out.name, of_section)
    rate = faster * experiment.loading.cmod_rate_mm_per_min
    loading = experiment.loading.model_copy(update={"cmod_rate_mm_per_min": rate})
    experiment = experiment.model_copy(update={"loading": loading})
    images = Contents(labels=images.labels, creep=CreepRecord(READINGS, MASTIC.creep_compliance(READINGS)))
    write_bundle(out, experiment, images)
    bundle = read_bundle(out)
    truth, recording = draw_truth(request, bundle, of_truth), recording_of(bundle, request, Clock())
    frames = recording.frame_cmod[recording.frame_cmod > 0]
    end = recording.cmod_max * (1 + 1e-6)
    problem = build_model(bundle).problem(truth.f_max, truth.delta_max, frames=frames, cmod_max=end, law=CREEPING)
    progress.stage("breaking it")
    solution = engine_of(engine).solve(problem)
    curve, field = noisy_record(*exact_record(problem, solution, recording), recording, of_noise)
    contents = Contents(curve, field, creep=images.creep)
    write_bundle(out, with_noise(experiment, request), contents)
    known = {"f_max_n": truth.f_max, "delta_max_m": truth.delta_max, "radius_mm": truth.radius / MM}
    write_atomically(out / "truth.json", json.dumps(known).encode())


def creep_table(trials: Sequence[CreepTrial]) -> str:
    """Trials as a Markdown table, the median of each geometry at its foot."""
    rows = [
        "| test | elastic fit: f_max | delta_max | viscoelastic fit: f_max | delta_max | truth in interval "
        "| f_max, elastic over viscoelastic | by the paper's multinomial |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for one in trials:
        inside = ", ".join("yes" if yes else "no" for yes in one.inside)
        fits, shifts = _told(*one.elastic, *one.viscoelastic), _told(one.shift, one.paper_shift)
        rows.append(f"| {one.name} | {fits} | {inside} | {shifts} |")
    for geometry in dict.fromkeys(one.name.split(",")[0] for one in trials):
        group = [one for one in trials if one.name.startswith(f"{geometry},")]
        middle = np.nanmedian([[*o.elastic, *o.viscoelastic, o.shift, o.paper_shift] for o in group], axis=0)
        rows.append(f"| **median, {geometry}** | {_told(*middle[:4])} | | {_told(*middle[4:])} |")
    return "\n".join(rows) + "\n"


def _told(*ratios: float) -> str:
    return " | ".join("edge" if np.isnan(ratio) else f"{ratio - 1:+.1%}" for ratio in ratios)
