"""A bundle of known truth that identifies in seconds: the engine's own test of a coarse lattice, with noise."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.field import DisplacementField
from pipeline.core.problem import Problem, Solution
from pipeline.core.units import MM
from pipeline.lmp.simulate import solve
from pipeline.store.bundle import read_bundle
from pipeline.store.creep import CreepRecord
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, first_experiment, write_bundle
from pipeline.store.sections import PixelFrame
from pipeline.study.assembly import CREEPING, build_model
from pipeline.study.observation import observe_solution

RADIUS_MM = 2.0
F_MAX, DELTA_MAX = 71.0 * RADIUS_MM / 0.3, 1.14e-4  # N, m; the truth, and the start: no grid has to move
NOISE = 4e-7  # m, of one displacement component
CMOD_MAX_MM = 0.3
STATIONS = {"cmod_count": 5, "cmod_step_mm": 0.04}


def coarse_experiment(name: str = "coarse") -> Experiment:
    """The paper's SE(B) of `RADIUS_MM`, with a short test and few stations; needs no image."""
    first = first_experiment("seb", name)
    raw = first.model_dump(exclude_none=True)
    raw["model"]["particle_radius_mm"] = RADIUS_MM
    raw["start"] = {"f_max_n": F_MAX, "delta_max_m": DELTA_MAX}
    raw["loading"]["cmod_max_mm"] = CMOD_MAX_MM
    raw["observation"] |= STATIONS
    return Experiment.model_validate(raw)


def labels_of_one_stone() -> tuple[np.ndarray, PixelFrame]:
    """A label image of the beam, half a millimetre a pixel, with one round stone beside the notch."""
    columns, rows = np.meshgrid(np.arange(275), np.arange(121))
    stone = np.hypot(columns - 165.0, rows - 50.0) < 16
    return np.where(stone, 2, 1).astype(np.uint8), PixelFrame(mm_per_px=0.5, origin_px=(137.0, 120.0))


def make_bundle(folder: Path, seed: int = 0, creep: CreepRecord | None = None) -> Path:
    """Simulate the truth once, add noise, write the bundle; with a creep record the mastic of the truth creeps."""
    labels, frame = labels_of_one_stone()
    experiment = coarse_experiment(folder.name)
    specimen = experiment.specimen.model_copy(update={"image": frame})
    experiment = experiment.model_copy(update={"specimen": specimen})
    write_bundle(folder, experiment, Contents(labels=labels, creep=creep))
    frames = np.arange(0.01, CMOD_MAX_MM, 0.01) * MM
    problem = build_model(read_bundle(folder)).problem(F_MAX, DELTA_MAX, frames=frames, law=creep and CREEPING)
    solution = solve(problem)
    field = _noisy_field(problem, solution, np.random.default_rng(seed))
    contents = Contents(curve=_record(solution.curve), fields=field, labels=labels, creep=creep)
    write_bundle(folder, experiment, contents)
    return folder


def edit(folder: Path, **values: str) -> None:
    """Set keys of experiment.toml, wherever they stand, to values as they are written there."""
    path = folder / "experiment.toml"
    text = path.read_text("utf-8")
    for key, value in values.items():
        text, count = re.subn(rf"^(?:# )?{key} *=.*$", lambda _, k=key, v=value: f"{k} = {v}", text, flags=re.M)
        assert count, f"{key} is not in {path}"
    path.write_text(text, "utf-8")


def _noisy_field(problem: Problem, solution: Solution, random: np.random.Generator) -> DisplacementField:
    """The displacements around the ligament, counted by time."""
    x, y = np.meshgrid(np.arange(-12, 12.1, 1.5), np.arange(15, 30.1, 1.5))
    points = np.column_stack([x.ravel(), y.ravel()]) * MM
    seen = observe_solution(problem, solution, points)
    seen = seen + random.normal(0, NOISE, seen.shape)
    valid = np.isfinite(seen[..., 0])
    time = solution.cmod / problem.cmod_rate
    return DisplacementField(points, np.where(valid[..., None], seen, 0), valid, np.full(valid.shape, NOISE), time)


def _record(curve: LoadCurve) -> LoadCurve:
    """A few hundred rows in which time and CMOD grow."""
    step = max(1, curve.cmod.size // 300)
    time, cmod, load = (a[::step] for a in (curve.time, curve.cmod, curve.load))
    grows = np.concatenate([[True], np.diff(np.maximum.accumulate(cmod)) > 0])
    return LoadCurve(time[grows], cmod[grows], load[grows])
