"""A virtual fracture test: what machine and camera would record of a specimen whose properties are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.clock import steady
from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField
from pipeline.core.observation import observe
from pipeline.core.particles import Phase
from pipeline.core.problem import Problem, Solution
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.gap.plan import Plan
from pipeline.materials.burgers import Burgers
from pipeline.materials.mixture import Mixture
from pipeline.twin.calibration import CutCheck, calibrated_factors, check_factors
from pipeline.twin.effects import Record, put_down, refuse_unknown, spoiled, with_effects, with_voids
from pipeline.twin.network import irregular_network
from pipeline.twin.problem import Factors, PhaseAt, Truth, twin_problem

PARTED = 0.1  # of delta_max: a bond opened farther no longer joins two crack flanks

Solve = Callable[[Problem], Solution]


@dataclass(frozen=True)
class Recording:
    """How a virtual test is recorded.

    Parameters
    ----------
    cmod_rate : float, m/s
    cmod_max : float, m; end of the test
    frames : int; images, at equal times from the unloaded specimen to the end
    before : int; more images of the unloaded specimen, before the loading begins
    phase : float, 0 to 1; by this share of their distance the images are earlier than the start of the loading
    rest : float, s; record before the loading begins
    sampling : float, 1/s; rows of the load record per second
    grid_step : float, m; distance of measured points
    roi : float, m; side of the square around the notch tip in which displacements are measured
    displacement_std : float, m; white noise of one displacement component
    load_std : float, N; white noise of the load
    cmod_std : float, m; white noise of the clip gauge
    """

    cmod_rate: float
    cmod_max: float
    frames: int = 61
    before: int = 0
    phase: float = 0.0
    rest: float = 0.0
    sampling: float = 5.0
    grid_step: float = 1.5 * MM
    roi: float = 45 * MM
    displacement_std: float = 0.0
    load_std: float = 0.0
    cmod_std: float = 0.0

    def __post_init__(self) -> None:
        positive = {"cmod_rate": "m/s", "cmod_max": "m", "sampling": "1/s", "grid_step": "m", "roi": "m"}
        for name, unit in positive.items():
            if not getattr(self, name) > 0:
                raise InputError(f"{name} = {getattr(self, name):g} {unit} of a virtual test must be positive")
        for name, unit in {"displacement_std": "m", "load_std": "N", "cmod_std": "m"}.items():
            if not getattr(self, name) >= 0:
                raise InputError(f"{name} = {getattr(self, name):g} {unit} of a virtual test must not be negative")
        if self.frames < 3:
            raise InputError(f"{self.frames} frames: a virtual test needs at least 3")
        if self.before < 0 or not 0 <= self.phase <= 1 or not self.rest >= 0:
            raise InputError(
                f"before = {self.before}, phase = {self.phase:g}, rest = {self.rest:g} s of a virtual test: frames and "
                "seconds before the loading must not be negative, the phase lies between 0 and 1"
            )

    @property
    def frame_time(self) -> np.ndarray:
        """(before + frames,) array, s, on the clock of the record."""
        end = self.cmod_max / self.cmod_rate
        step = end / (self.frames - 1)
        early = -step * (np.arange(self.before, 0, -1) + self.phase)
        return self.rest + np.concatenate([early, np.linspace(0.0, end, self.frames) - step * self.phase])

    @property
    def frame_cmod(self) -> np.ndarray:
        """(before + frames,) array, m; zero before the loading."""
        return self.cmod_at(self.frame_time)

    def cmod_at(self, time: np.ndarray) -> np.ndarray:
        """CMOD (m) at times (s): at rest, then a ramp."""
        return np.maximum(time - self.rest, 0.0) * self.cmod_rate


@dataclass(frozen=True)
class VirtualTest:
    """The recorded test, and what no identifying program may see.

    Parameters
    ----------
    curve : LoadCurve with noise
    field : DisplacementField with noise, counted by time, from the unloaded state
    exact_curve, exact_field : the same without noise
    factors : Factors of the network
    check : CutCheck; how well the network stands for the lattice, on straight cuts
    pitch : float, m
    loading_begins : float, s, on the clock of the record
    problem : Problem; the network
    solution : Solution of the engine
    mastic : Burgers; how the mastic crept, or None
    """

    curve: LoadCurve
    field: DisplacementField
    exact_curve: LoadCurve
    exact_field: DisplacementField
    factors: Factors
    check: CutCheck
    pitch: float
    loading_begins: float
    problem: Problem
    solution: Solution
    mastic: Burgers | None = None

    @property
    def particles(self) -> int:
        return self.problem.particles.count

    @property
    def bonds(self) -> int:
        return self.problem.bonds.count


def virtual_test(
    specimen: Specimen,
    phase_at: PhaseAt,
    mixture: Mixture,
    truth: Truth,
    recording: Recording,
    pitch: float,
    rng: np.random.Generator,
    solve: Solve,
    factors: Factors | None = None,
    plan: Plan | None = None,
    mastic: Burgers | None = None,
    measuring: Mapping[str, float] | None = None,
) -> VirtualTest:
    """Make a network, break it and record it.

    Parameters
    ----------
    specimen : Specimen
    phase_at : points (n, 2) in m → phase and stone number, as `PhaseMap.at`
    mixture : Mixture; moduli and ratios
    truth : Truth; f_max and delta_max as the identifying lattice counts them
    recording : Recording
    pitch : float, m; of the irregular network
    rng : numpy Generator; network and noise come from it
    solve : engine, Problem → Solution
    factors : Factors; those of `twin.calibration` where not given
    plan : Plan; the test as it really is, where physics effects make it another one than specimen and mixture say
    mastic : Burgers; how the mastic creeps where the plan says that it does, in the time of the recording
    measuring : measurement effect → value

    Raises
    ------
    InputError
        where the plan says that the mastic creeps, and nothing how
    """
    plan = Plan(specimen, mixture) if plan is None else plan
    refuse_unknown(plan)
    of_network, of_noise, of_cuts = rng.spawn(3)
    of_effects = of_network.spawn(1)[0]
    network = irregular_network(plan.specimen, pitch, of_network)
    stones = bool((phase_at(network.position)[0] == Phase.AGGREGATE).any())
    factors = calibrated_factors(stones) if factors is None else factors
    phase_at = with_voids(phase_at, plan.specimen, plan.void_share, of_effects)
    stations = recording.frame_cmod[recording.frame_cmod > 0]
    problem = twin_problem(
        plan.specimen,
        network,
        phase_at,
        plan.mixture,
        truth,
        factors,
        recording.cmod_max * (1 + 1e-6),
        stations,
        creep=_creep(plan, mastic),
    )
    clock = steady(recording.cmod_rate) if plan.creep else None
    problem = with_effects(replace(problem, cmod_rate=recording.cmod_rate, clock=clock), plan)
    solution = put_down(problem, solve(problem), plan)
    curve, field = exact_record(replace(problem, specimen=specimen), solution, recording)
    record = Record(curve, field, specimen, of_effects.uniform(0, 2 * np.pi))
    record = spoiled(record, measuring or {})
    curve, field = record.curve, record.field
    noisy_curve, noisy_field = noisy_record(curve, field, recording, of_noise)
    return VirtualTest(
        curve=noisy_curve,
        field=noisy_field,
        exact_curve=curve,
        exact_field=field,
        factors=factors,
        check=check_factors(network, of_cuts),
        pitch=pitch,
        loading_begins=recording.rest,
        problem=problem,
        solution=solution,
        mastic=_creep(plan, mastic),
    )


def _creep(plan: Plan, mastic: Burgers | None) -> Burgers | None:
    """How the mastic of the plan's mixture creeps; None: not at all."""
    if not plan.creep:
        return None
    if mastic is None:
        raise InputError("the mastic creeps, but nothing says how: give its creep compliance")
    return mastic.like(plan.mixture.mastic_modulus, plan.creep)


def exact_record(problem: Problem, solution: Solution, recording: Recording) -> tuple[LoadCurve, DisplacementField]:
    """What machine and camera see of a solution whose frames are the recording's, without noise."""
    return _record(solution.curve, recording), _film(problem, solution, recording)


def noisy_record(
    curve: LoadCurve, field: DisplacementField, recording: Recording, rng: np.random.Generator
) -> tuple[LoadCurve, DisplacementField]:
    """A record with the white noise of clip gauge, load cell and correlation."""
    return _noisy_curve(curve, recording, rng), _noisy_field(field, recording, rng)


def measuring_points(specimen: Specimen, recording: Recording) -> np.ndarray:
    """The regular grid (p, 2), m, around the notch tip, without points outside or on the notch line."""
    half = int(recording.roi / recording.grid_step / 2)
    steps = np.arange(-half, half + 1) * recording.grid_step
    x, y = np.meshgrid(steps + specimen.tip[0], steps + specimen.tip[1])
    points = np.column_stack([x.ravel(), y.ravel()])
    on_notch = (np.abs(points[:, 0]) < recording.grid_step / 2) & (points[:, 1] < specimen.tip[1])
    return points[specimen.contains(points) & ~on_notch]


def _record(curve: LoadCurve, recording: Recording) -> LoadCurve:
    """The exact curve at the rows of the load record, the CMOD growing at its constant rate."""
    end = recording.rest + recording.cmod_max / recording.cmod_rate
    time = np.arange(int(end * recording.sampling) + 1) / recording.sampling
    cmod = recording.cmod_at(time)
    line = np.full(cmod.size, np.nan) if curve.load_line is None else np.interp(cmod, curve.cmod, curve.load_line)
    return LoadCurve(time=time, cmod=cmod, load=np.interp(cmod, curve.cmod, curve.load), load_line=line)


def _film(problem: Problem, solution: Solution, recording: Recording) -> DisplacementField:
    """Displacements of the measuring points in every frame, the first ones those of the unloaded specimen."""
    points = measuring_points(problem.specimen, recording)
    parted = PARTED * problem.law.delta_max
    values, valid = observe(problem.particles, problem.bonds, solution.displacement, points, parted)
    still = int(np.count_nonzero(recording.frame_cmod == 0))
    values = np.concatenate([np.zeros((still, len(points), 2)), np.where(valid[..., None], values, np.nan)])
    valid = np.concatenate([np.repeat(valid[:1], still, axis=0), valid])
    time = recording.frame_time[: len(values)]
    return DisplacementField(points, values, valid, np.full(valid.shape, recording.displacement_std), time)


def _noisy_curve(curve: LoadCurve, recording: Recording, rng: np.random.Generator) -> LoadCurve:
    size = curve.load.size
    return replace(
        curve,
        cmod=curve.cmod + recording.cmod_std * rng.standard_normal(size),
        load=curve.load + recording.load_std * rng.standard_normal(size),
        load_std=np.full(size, recording.load_std),
    )


def _noisy_field(field: DisplacementField, recording: Recording, rng: np.random.Generator) -> DisplacementField:
    noise = recording.displacement_std * rng.standard_normal(field.displacement.shape)
    return replace(field, displacement=field.displacement + noise)
