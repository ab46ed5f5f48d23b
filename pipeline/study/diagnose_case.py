"""A bundle made ready to be diagnosed: what it shows, and simulations of it with effects in them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pipeline.config import RunSettings
from pipeline.core.errors import InputError, PipelineError, UnavailableError
from pipeline.core.problem import Problem, Solution
from pipeline.execution.progress import Progress
from pipeline.execution.simulations import SimulationError, run_all
from pipeline.gap.diagnosis import Outcome, Run
from pipeline.gap.response import Abscissae, Response
from pipeline.store.bundle import Bundle
from pipeline.store.problem_key import problem_key
from pipeline.store.results import prepare_output
from pipeline.store.simulation import SimulationStore
from pipeline.store.start import start_parameters
from pipeline.study.assembly import Model, build_model
from pipeline.study.diagnose_sight import HALF, SPACINGS, Seen, beside, own_path, seen
from pipeline.study.dic import FOLDER as DIC_FOLDER
from pipeline.study.dic import measured_fields, with_measured_fields
from pipeline.study.effects import Band, held_to, lattice_problem, planned, settled
from pipeline.study.engines import Engine
from pipeline.study.engines import engine as engine_of
from pipeline.study.observation import observe_solution

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
    spent : list of float; seconds of every call
    executor : Executor or None; None: processes of its own for every call
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
    spent: list[float] = field(default_factory=list)
    executor: Executor | None = None

    def problem(self, run: Run) -> Problem:
        """The test of one run."""
        if run.placement != (0.0, 0.0):
            return self._elsewhere(run)
        a = self.abscissae
        end = max(a.field[-1], a.load[-1]) * (1 + 1e-6)
        problem = self.model.problem(run.f_max, run.delta_max, frames=a.field, cmod_max=end, accuracy=self.accuracy)
        if run.effects:
            plan = planned(self.model.bundle.specimen, self.model.mixture, dict(run.effects))
            problem = lattice_problem(self.model, plan, problem, run.f_max, run.delta_max)
        return problem if self.band is None else held_to(problem, self.band)

    def _elsewhere(self, run: Run) -> Problem:
        """The same test with the lattice moved by shares of its periods along and across the rows."""
        period = self.model.particles.radius * np.array([2.0, 2 * np.sqrt(3.0)])
        along, across = run.placement * period
        moved = replace(self, model=self.model.placed((float(along), float(across))))
        return moved.problem(replace(run, placement=(0.0, 0.0)))

    def __call__(self, runs: Sequence[Run]) -> list[Outcome]:
        """What every run shows, or why there is none."""
        began = time.monotonic()
        found = self._outcomes(runs)
        self.spent.append(time.monotonic() - began)
        return found

    def _outcomes(self, runs: Sequence[Run]) -> list[Outcome]:
        problems: list[Problem | str] = [self._tried(run) for run in runs]
        keys = [p if isinstance(p, str) else problem_key(p, self.engine.label) for p in problems]
        wanted = {k: p for k, p in zip(keys, problems, strict=True) if not isinstance(p, str)}
        names = {k: _name(run) for k, run in zip(keys, runs, strict=True)}
        seen_in = {k: self._kept(k, p) for k, p in wanted.items()}  # read once: a file takes as long as a fit
        missing = {k: p for k, p in wanted.items() if seen_in[k] is None}
        failed: dict[str, BaseException] = {}
        try:
            run_all(
                self.engine.solve, missing, self.store, executor=self.executor, workers=self.workers,
                progress=self.progress, names=names,
            )  # fmt: skip
        except SimulationError as error:
            failed = error.failures
        seen_in |= {k: self._kept(k, p) for k, p in missing.items()}
        why = {k: str(failed.get(name, "it was not kept")) for k, name in names.items()}
        return [p if isinstance(p, str) else seen_in[k] or why[k] for k, p in zip(keys, problems, strict=True)]

    def _kept(self, key: str, problem: Problem) -> Response | None:
        """What a simulation shows that is kept."""
        solution = self.store.get(key)
        return None if solution is None else self.response(problem, solution)

    def response(self, problem: Problem, solution: Solution) -> Response:
        """A solution at the points and abscissae."""
        a, level = self.abscissae, settled(problem, solution)
        seen_there = observe_solution(problem, level, self.points)
        whole = np.full((a.field.size, len(self.points), 2), np.nan)
        whole[: len(seen_there)] = seen_there
        return Response(whole, solution.curve.load_at(a.load))

    def _tried(self, run: Run) -> Problem | str:
        try:
            return self.problem(run)
        except (UnavailableError, InputError) as error:
            return str(error)


def _name(run: Run) -> str:
    changed = ", ".join(f"{name} = {value:.3g}" for name, value in run.effects)
    return f"f_max = {run.f_max:.4g} N, delta_max = {run.delta_max:.4g} m" + (f", {changed}" if changed else "")


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


@dataclass(frozen=True, eq=False)
class Case:
    """A bundle and everything that its diagnosis needs.

    Parameters
    ----------
    bundle : Bundle, with the fields of its images
    folder : Path of its results
    model : Model
    look : Seen, points near the crack left out
    simulator : Simulator, damage held to the band
    band : Band
    """

    bundle: Bundle
    folder: Path
    model: Model
    look: Seen
    simulator: Simulator
    band: Band


def prepared(
    bundle: Bundle,
    folder: Path,
    engine: str,
    settings: RunSettings,
    progress: Progress,
    executor: Executor | None = None,
) -> Case:
    """Correlate a bundle's images where it has some, build its model, find its crack.

    Parameters
    ----------
    bundle : Bundle
    folder : Path; of its results, which exists
    engine : str
    settings : RunSettings
    progress : Progress
    executor : Executor or None; None: every simulation in a process of its own
    """
    if bundle.images:
        found = measured_fields(bundle, folder / DIC_FOLDER, settings, progress)
        bundle = with_measured_fields(bundle, found)
    model, look = build_model(bundle, settings.radius), seen(bundle)
    store = SimulationStore(prepare_output(folder / "simulations"))
    simulator = Simulator(
        model, look.observation.sight.points, look.abscissae, None, engine_of(engine), store, settings.accuracy,
        settings.workers, progress, executor=executor,
    )  # fmt: skip
    band = band_of(look, simulator, start_parameters(bundle))
    look = replace(look, observation=beside(look.observation, band.path))
    return Case(bundle, folder, model, look, replace(simulator, band=band), band)
