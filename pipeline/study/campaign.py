"""The simulations of an estimation: a grid that may move, placements of its lattice, the optimum."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.config import RunSettings
from pipeline.core.errors import InputError, StoreError
from pipeline.core.problem import Problem, Solution
from pipeline.execution.processes import workers_of
from pipeline.execution.progress import Progress
from pipeline.execution.simulations import run_all
from pipeline.inverse.design import Design
from pipeline.inverse.estimate import Estimate, Settings, Surrogate, estimate
from pipeline.inverse.objective import Objective, Rigid
from pipeline.inverse.observations import Measured, Simulated
from pipeline.inverse.placements import Placements
from pipeline.microstructure.packing import Lattice
from pipeline.store.bundle import Bundle
from pipeline.store.problem_key import problem_key
from pipeline.store.results import prepare_output
from pipeline.store.simulation import SimulationStore
from pipeline.store.start import start_parameters
from pipeline.study.agreement import curve_difference, field_difference
from pipeline.study.assembly import CREEPING, Model, build_model
from pipeline.study.dic import FOLDER as DIC_FOLDER
from pipeline.study.dic import measured_fields, with_measured_fields
from pipeline.study.dic import summary as summary_of_images
from pipeline.study.engines import Engine
from pipeline.study.engines import engine as engine_of
from pipeline.study.levelling import Leveller, leveller, refuse_unlevelled
from pipeline.study.observation import at_stations, measured_test, observe_solution
from pipeline.study.output import results_folder
from pipeline.study.prospects import refuse_hopeless, refuse_inert
from pipeline.study.ratios import Between, between
from pipeline.study.scaling import leading_problem, member_solution, scaling_groups

TRIES = 5  # placements looked at for each that is wanted


@dataclass(frozen=True)
class Campaign:
    """Everything that stays the same while the grid moves.

    Parameters
    ----------
    model : Model
    measured : Measured
    points : (p, 2) array, m; where fields are compared, empty without fields
    settings : RunSettings
    engine : Engine
    store : SimulationStore
    progress : Progress
    used : keys of the simulations that took part so far; the store may hold others
    remarks : what a reader should know of the last grid
    leveller : Leveller, or None: simulations are observed as they are
    executor : Executor, or None: processes of this machine
    """

    model: Model
    measured: Measured
    points: np.ndarray
    settings: RunSettings
    engine: Engine
    store: SimulationStore
    progress: Progress
    used: set[str]
    remarks: list[str]
    leveller: Leveller | None = None
    executor: Executor | None = None

    def problem(self, f_max: float, delta_max: float) -> Problem:
        """The test at one node of the grid."""
        return self.problem_of(self.model, f_max, delta_max)

    def problem_of(self, model: Model, f_max: float, delta_max: float) -> Problem:
        """The test at one node of the grid, of a model that differs in placement or material."""
        law = CREEPING if self.settings.viscoelastic else None
        return model.problem(f_max, delta_max, accuracy=self.settings.accuracy, law=law)

    def grid(self, nodes: list[tuple[float, float]]) -> list[tuple[Problem, Solution]]:
        """All nodes of a grid, in order: simulated, or interpolated between a few ratios where the settings say so."""
        count = self.settings.ratio_count
        if count is None:
            return self.solutions(nodes)
        found = between(nodes, count, self.problem, self.solved)
        lacking = [k for k, (_, solution) in enumerate(found.runs) if solution is None]
        direct = dict(zip(lacking, self.solutions([nodes[k] for k in lacking]), strict=True))
        self.remarks[:] = [self._missed(found, len(lacking))]
        return [direct[k] if solution is None else (p, solution) for k, (p, solution) in enumerate(found.runs)]

    def _missed(self, found: Between, direct: int) -> str:
        """How far the interpolation in the ratio errs where it was tried."""
        at = self.measured.cmod
        load = [curve_difference(guess.curve, true.curve, at[at <= t.cmod_max]) for t, true, guess in found.trials]
        told = f"{max(load, default=np.nan):.1%} in the load"
        if self.points.size:
            pairs = [self.seen([(t, guess), (t, true)]) for t, true, guess in found.trials]
            told += f" and {max((field_difference(*pair) for pair in pairs), default=np.nan):.1%} in the fields"
        return (
            f"nodes were interpolated between {self.settings.ratio_count} ratios delta_max/f_max ({direct} simulated): "
            f"each simulation left out in turn is missed by {told} at most, over twice the distance"
        )

    def solutions(self, nodes: list[tuple[float, float]]) -> list[tuple[Problem, Solution]]:
        """Simulate the nodes that the store does not hold; all of them, in order."""
        if self.settings.scaling:
            self._scale(nodes)
        return self.solved([(_told(*node), self.problem(*node)) for node in nodes])

    def _scale(self, nodes: list[tuple[float, float]]) -> None:
        """Keep what one simulation gives of nodes with the same delta_max/f_max, where that is exact."""
        leads: list[tuple[str, Problem]] = []
        followers: list[list[tuple[Problem, float]]] = []
        for group in scaling_groups(nodes):
            members = [(self.problem(*nodes[k]), factor) for k, factor in group]
            if sum(self._missing(problem) for problem, _ in members) < 2:
                continue
            leads.append(
                (_led(nodes[group[0][0]], len(group)), leading_problem(members[0][0], [f for _, f in members]))
            )
            followers.append(members)
        for (lead, found), members in zip(self.solved(leads), followers, strict=True):
            for problem, factor in members:
                scaled = member_solution(found, lead, problem, factor)
                if scaled is not None and self._missing(problem):
                    self.store.put(problem_key(problem, self.engine.label), scaled)

    def _missing(self, problem: Problem) -> bool:
        return problem_key(problem, self.engine.label) not in self.store

    def solved(self, problems: list[tuple[str, Problem]]) -> list[tuple[Problem, Solution]]:
        """Simulate the named problems that the store does not hold; all of them, in order."""
        keys = [problem_key(problem, self.engine.label) for _, problem in problems]
        wanted = {key: problem for key, (_, problem) in zip(keys, problems, strict=True)}
        names = {key: name for key, (name, _) in zip(keys, problems, strict=True)}
        here = self.executor is None
        run_all(
            self.engine.solve,
            wanted,
            self.store,
            executor=self.executor,
            workers=workers_of(self.settings.ranks, self.settings.workers) if here else None,
            progress=self.progress,
            names=names,
        )
        self.used.update(wanted)
        return [(problem, self._read(key)) for key, (_, problem) in zip(keys, problems, strict=True)]

    def seen(self, runs: list[tuple[Problem, Solution]]) -> list[np.ndarray]:
        """Displacements (s, p, 2) in m of the points at the stations, one array a simulation."""
        if self.leveller is not None:
            self.progress.begin(len(runs), 0, "levelled simulation")
        found = []
        for problem, solution in runs:
            if self.leveller is None:
                values = observe_solution(problem, solution, self.points)
            else:
                values = self.leveller.seen(problem, solution)
                self.progress.done("levelled")
            found.append(at_stations(values, solution, self.measured.cmod))
        return found

    def kept(self, nodes: list[tuple[float, float]]) -> list[tuple[Problem, Solution]]:
        """The nodes of a grid as the store holds them, in order; refuses where one is missing."""
        if self.settings.ratio_count is not None:
            return self.grid(nodes)
        problems = [self.problem(*node) for node in nodes]
        return [(problem, self._read(problem_key(problem, self.engine.label))) for problem in problems]

    def _read(self, key: str) -> Solution:
        solution = self.store.get(key)
        if solution is None:
            raise StoreError(f"{self.store.path(key)} cannot be read back: give the same command again")
        return solution


def _told(f_max: float, delta_max: float) -> str:
    return f"f_max = {f_max:.4g} N, delta_max = {delta_max:.4g} m"


def _led(node: tuple[float, float], count: int) -> str:
    return f"{_told(*node)}, for {count} nodes of this ratio"


def prepare(
    read: Bundle,
    out: Path,
    settings: RunSettings,
    progress: Progress,
    executor: Executor | None = None,
) -> tuple[Campaign, Objective, Path]:
    """Everything that an estimation needs before the first simulation: campaign, objective and folder of results."""
    chosen = engine_of(settings.engine, settings.ranks)
    aim = choose_objective(read, settings.objective)
    refuse_unlevelled(read, settings, aim)
    folder = results_folder(out, read)
    model = build_model(read, settings.radius)
    model = from_images(model, aim, folder, settings, progress)
    read = model.bundle
    field = read.need_fields() if aim is not Objective.LOAD else None
    measured = measured_test(read.need_curve(), field, read.stations, read.observation_points)
    refuse_hopeless(model, measured, aim, Rigid(settings.rigid))
    refuse_inert(model, settings.more_parameters, aim)
    if settings.viscoelastic:
        model.burgers  # noqa: B018 - refuses before anything runs
    points = np.zeros((0, 2)) if measured.field is None else measured.field.points
    store = SimulationStore(prepare_output(folder / "simulations"))
    level = leveller(read, settings, points, folder, chosen.label) if settings.levelling else None
    campaign = Campaign(model, measured, points, settings, chosen, store, progress, set(), [], level, executor)
    return campaign, aim, folder


def choose_objective(bundle: Bundle, wanted: str | None) -> Objective:
    """What to compare: as asked, else fields where there are some or images of them, else the load."""
    if wanted is not None:
        return Objective(wanted)
    return Objective.FIELDS if bundle.images or bundle.fields is not None else Objective.LOAD


def from_images(model: Model, aim: Objective, folder: Path, settings: RunSettings, progress: Progress) -> Model:
    """The model, its bundle with the fields of its images where fields are compared; these are kept in FOLDER/dic.

    What can be refused without the fields is refused before they are measured.
    """
    bundle = model.bundle
    if not bundle.images or aim is Objective.LOAD:
        return model
    bare = measured_test(bundle.need_curve(), None, bundle.stations, bundle.observation_points)
    refuse_hopeless(model, bare, Objective.LOAD, Rigid(settings.rigid))
    found = measured_fields(bundle, folder / DIC_FOLDER, settings, progress)
    told = (f"images: {summary_of_images(found.result)}", *found.result["warnings"])
    return replace(model, bundle=with_measured_fields(bundle, found), remarks=(*model.remarks, *told))


def first_grid(campaign: Campaign) -> Design:
    """The grid around the start of the search."""
    settings = campaign.settings
    return Design(start_parameters(campaign.model.bundle), settings.f_factors, settings.delta_factors)


def search(campaign: Campaign, aim: Objective) -> Estimate:
    """Estimate on the grid, then again with the mean of several placements of its lattice near the optimum."""
    settings = campaign.settings
    start = first_grid(campaign)
    campaign.progress.stage(f"{np.prod(start.shape)} simulations")
    found = centred(campaign, start, aim)
    if not (settings.placement_count and found.accepted):
        return found
    campaign.progress.stage(f"{settings.placement_count} other placements of the lattice")
    return centred(campaign, found.design, aim, placed_elsewhere(campaign, found, aim))


def placed_elsewhere(campaign: Campaign, found: Estimate, aim: Objective) -> Placements:
    """Simulate the optimum on the grid's lattice and on others of its kind that lie elsewhere."""
    model, settings = campaign.model, campaign.settings
    models = [model, *elsewhere(model, settings.placement_count)]
    runs = campaign.solved(
        [
            (f"placement {k} of the lattice", campaign.problem_of(one, found.f_max, found.delta_max))
            for k, one in enumerate(models)
        ]
    )
    seen = None if aim is Objective.LOAD else np.stack(campaign.seen(runs))
    return Placements(seen, np.stack([solution.curve.load_at(campaign.measured.cmod) for _, solution in runs]))


def elsewhere(model: Model, count: int) -> Iterator[Model]:
    """The specimen on `count` placements of its lattice; one that leaves a grip too few particles is passed over."""
    lattice = Lattice(model.particles.radius, model.bundle.model.lattice_angle)
    built = 0
    for shift in lattice.placements(TRIES * count):
        with suppress(InputError):
            yield model.placed(shift)
            built += 1
        if built == count:
            return


def centred(campaign: Campaign, design: Design, aim: Objective, placed: Placements | None = None) -> Estimate:
    """Estimate on a grid; where the optimum lies on its edge, move the grid and estimate again."""
    settings = campaign.settings
    found = estimate_on(campaign, design, aim, placed)
    for move in range(settings.recentring_count):
        moved = design.recentred(found.f_max, found.delta_max, settings.recentring_steps)
        if moved == design:
            break
        design = moved
        campaign.progress.stage(f"grid moved, {move + 1} of at most {settings.recentring_count}")
        found = estimate_on(campaign, design, aim, placed)
    return found


def estimate_on(campaign: Campaign, design: Design, aim: Objective, placed: Placements | None = None) -> Estimate:
    """Simulate a grid and estimate on it."""
    runs = campaign.grid(design.nodes())
    stations = campaign.measured.cmod
    loads = [solution.curve.load_at(stations) for _, solution in runs]
    seen = None
    if aim is not Objective.LOAD:
        seen = campaign.seen(runs)
    simulated = Simulated.of(design, seen, loads)
    return estimate(design, simulated, campaign.measured, how_to(campaign.settings, aim), placed)


def how_to(settings: RunSettings, aim: Objective) -> Settings:
    """How an estimate is made, from the settings of a run."""
    return Settings(aim, settings.modulus_std, Rigid(settings.rigid), surrogate=Surrogate(settings.surrogate))


def run_optimum(campaign: Campaign, found: Estimate) -> tuple[Problem, Solution]:
    """Simulate the test at the estimate itself."""
    campaign.progress.stage("the optimum")
    [run] = campaign.solutions([(found.f_max, found.delta_max)])
    return run
