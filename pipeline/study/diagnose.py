"""The sim-to-real gap of a test: where it lies, which effect explains it, how far that closes it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.core.errors import InputError, PipelineError, UnavailableError
from pipeline.core.problem import Problem, Solution
from pipeline.execution.progress import Progress, Silent
from pipeline.execution.simulations import SimulationError, run_all
from pipeline.gap.diagnosis import FACTORS, Diagnosis, Outcome, Run
from pipeline.gap.diagnosis import diagnose as judge
from pipeline.gap.library import nearest, shipped
from pipeline.gap.response import Abscissae, Response
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.layouts import DIAGNOSE
from pipeline.store.problem_key import problem_key
from pipeline.store.results import prepare_output, write_arrays, write_result
from pipeline.store.simulation import SimulationStore
from pipeline.store.start import start_parameters
from pipeline.study.assembly import Model, build_model, settings_of
from pipeline.study.diagnose_arrays import diagnosis_arrays
from pipeline.study.diagnose_result import diagnosis_result, sentence
from pipeline.study.diagnose_sight import HALF, SPACINGS, Seen, beside, own_path, seen
from pipeline.study.dic import FOLDER as DIC_FOLDER
from pipeline.study.dic import measured_fields, with_measured_fields
from pipeline.study.effects import Band, held_to, lattice_problem, planned, settled
from pipeline.study.engines import Engine
from pipeline.study.engines import engine as engine_of
from pipeline.study.observation import observe_solution
from pipeline.study.output import results_folder

ENGINE = "equilibrium"


@dataclass(frozen=True, eq=False)
class Simulator:
    """Simulations of one bundle with effects in them, kept and found again.

    Parameters
    ----------
    model : Model
    points : (p, 2) array, m
    abscissae : Abscissae
    band : Band or None; where bonds may be damaged
    engine : Engine
    store : SimulationStore
    accuracy : float
    workers : int or None
    progress : Progress
    """

    model: Model
    points: np.ndarray
    abscissae: Abscissae
    band: Band | None
    engine: Engine
    store: SimulationStore
    accuracy: float
    workers: int | None
    progress: Progress

    def problem(self, run: Run) -> Problem:
        """The test of one run."""
        a = self.abscissae
        end = max(a.field[-1], a.load[-1]) * (1 + 1e-6)
        problem = self.model.problem(run.f_max, run.delta_max, frames=a.field, cmod_max=end, accuracy=self.accuracy)
        if run.effects:
            plan = planned(self.model.bundle.specimen, self.model.mixture, dict(run.effects))
            problem = lattice_problem(self.model, plan, problem, run.f_max, run.delta_max)
        return problem if self.band is None else held_to(problem, self.band)

    def __call__(self, runs: Sequence[Run]) -> list[Outcome]:
        """What every run shows, or why there is none."""
        problems: list[Problem | str] = [self._tried(run) for run in runs]
        keys = [p if isinstance(p, str) else problem_key(p, self.engine.label) for p in problems]
        wanted = {k: p for k, p in zip(keys, problems, strict=True) if not isinstance(p, str)}
        names = {k: _name(run) for k, run in zip(keys, runs, strict=True)}
        failed: dict[str, BaseException] = {}
        try:
            run_all(self.engine.solve, wanted, self.store, workers=self.workers, progress=self.progress, names=names)
        except SimulationError as error:
            failed = error.failures
        found: list[Outcome] = []
        for key, problem in zip(keys, problems, strict=True):
            solution = None if isinstance(problem, str) else self.store.get(key)
            if solution is None:
                found.append(problem if isinstance(problem, str) else str(failed.get(names[key], "it was not kept")))
            else:
                assert not isinstance(problem, str)
                found.append(self.response(problem, solution))
        return found

    def response(self, problem: Problem, solution: Solution) -> Response:
        """A solution at the points and abscissae."""
        a, level = self.abscissae, settled(problem, solution)
        seen_there = observe_solution(problem, level, self.points)
        field = np.full((a.field.size, len(self.points), 2), np.nan)
        field[: len(seen_there)] = seen_there
        return Response(field, solution.curve.load_at(a.load))

    def _tried(self, run: Run) -> Problem | str:
        try:
            return self.problem(run)
        except (UnavailableError, InputError) as error:
            return str(error)


def _name(run: Run) -> str:
    changed = ", ".join(f"{name} = {value:.3g}" for name, value in run.effects)
    return f"f_max = {run.f_max:.4g} N, delta_max = {run.delta_max:.4g} m" + (f", {changed}" if changed else "")


def diagnose(
    bundles: Sequence[Path],
    out: Path,
    *,
    engine: str | None = None,
    radius_mm: float | None = None,
    accuracy: float | None = None,
    grid: tuple[float, ...] | None = None,
    without: Sequence[str] = (),
    config: Path | None = None,
    workers: int | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
) -> str:
    """Diagnose the gap of a test; writes result.json, figures, report.

    Finished simulations are kept in OUT/simulations: the same call goes on where it stopped.

    Parameters
    ----------
    bundles : folders
    out : folder
    grid : factors of the start, wider by default than those of an identification
    without : effects left out of the library
    the others : override the settings of `config`
    """
    if len(bundles) != 1:
        raise UnavailableError(
            f"{len(bundles)} bundles: replicates and transfer tests are not in this version: diagnose one at a time"
        )
    started = time.monotonic()
    options = {"radius_mm": radius_mm, "accuracy": accuracy, "workers": workers, "seed": seed}
    settings = settings_of(config, **options)
    chosen, progress = engine_of(engine or ENGINE), progress or Silent()
    read = read_bundle(bundles[0])
    folder = results_folder(out, read)
    if read.images:
        found = measured_fields(read, folder / DIC_FOLDER, settings, progress)
        read = with_measured_fields(read, found)
    model, look = build_model(read, settings.radius), seen(read)
    store = SimulationStore(prepare_output(folder / "simulations"))
    simulator = Simulator(
        model, look.observation.sight.points, look.abscissae, None, chosen, store, settings.accuracy, settings.workers,
        progress,
    )  # fmt: skip
    start = start_parameters(read)
    band = band_of(look, simulator, start)
    look = replace(look, observation=beside(look.observation, band.path))
    result, diagnosis = judged(read, model, look, replace(simulator, band=band), settings.seed, without, grid)
    result |= {"seconds": time.monotonic() - started, "engine": engine or ENGINE}
    write_arrays(folder, DIAGNOSE, diagnosis_arrays(diagnosis, band.path))
    write_result(folder, result)
    from pipeline.study.diagnose_page import diagnosis_page

    diagnosis_page(folder, model, look, diagnosis, result, band)
    return sentence(diagnosis)


def band_of(look: Seen, simulator: Simulator, start: tuple[float, float]) -> Band:
    """The strip around the measured crack; around the model's own at the start where none is seen."""
    half = max(HALF, SPACINGS * 2 * simulator.model.particles.radius)
    if look.path is not None:
        return Band(look.path, half)
    simulator.progress.stage("the model's own crack path")
    run = Run(*start)
    [outcome] = simulator([run])
    if isinstance(outcome, str):
        raise PipelineError(f"the model cannot be simulated at [start]: {outcome}")
    problem = simulator.problem(run)
    solution = simulator.store.get(problem_key(problem, simulator.engine.label))
    assert solution is not None
    law = problem.law
    damaged = np.where(np.isfinite(law.f_max), solution.reached / np.where(np.isfinite(law.f_max), law.delta_max, 1), 0)
    path = own_path(
        problem.particles.position, problem.bonds.pairs, np.minimum(damaged, 1.0), np.array(problem.specimen.tip)
    )
    return Band(path, half)


def judged(
    bundle: Bundle, model: Model, look: Seen, simulator: Callable[[Sequence[Run]], list[Outcome]], seed: int,
    without: Sequence[str],
    grid: tuple[float, ...] | None = None,
) -> tuple[dict, Diagnosis]:  # fmt: skip
    """The diagnosis and its result.json."""
    from pipeline.gap.effects import effect, library

    for name in without:
        effect(name)  # refuses what there is not
    names = [n for n in library() if n not in without]
    radius = model.particles.radius
    entry = nearest(shipped(), bundle.specimen.geometry, radius)
    warnings = entry.warnings(bundle.specimen.geometry, radius, look.observation)
    diagnosis = judge(
        look.observation,
        look.abscissae,
        simulator,
        start_parameters(bundle),
        entry,
        np.random.default_rng(seed),
        names,
        grid or FACTORS,
    )
    return diagnosis_result(bundle, look, diagnosis, warnings, radius), diagnosis
