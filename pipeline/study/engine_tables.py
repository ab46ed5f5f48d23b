"""Tables of how accurate and how fast the engines are, as Markdown."""

from __future__ import annotations

import resource
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from pipeline.core.problem import Kinematics, Solution
from pipeline.equilibrium import solve as equilibrium
from pipeline.lmp import simulate as lammps
from pipeline.study.agreement import peak_difference
from pipeline.study.engines import FORWARD, REFINED, Engine, engine
from pipeline.study.paths import apart, nearest_path
from pipeline.study.specimens import Trial, section_trial

TIGHTER = 0.1  # of the tolerance, in the runs that the engine is judged by


def engine_rows(trials: Sequence[Trial], accuracies: Sequence[float]) -> Iterator[str]:
    """LAMMPS against refined equilibria at equal kinematics, a line a run, as soon as it is finished.

    Where the crack jumps, against equilibria under a machine that only moves forward; how far it is from those under
    CMOD control is the last column.
    """
    yield "| specimen | asked | steps | seconds | load | field | peak | own estimate | path | CMOD control |"
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for trial in trials:
        turning = engine(REFINED).solve(trial.problem)
        jumps = "jumped" in turning.message
        limits: dict[str, Solution] = {} if jumps else {trial.name: turning}
        solve = partial(_kept, limits, engine(FORWARD if jumps else REFINED))
        for accuracy in accuracies:
            run = lammps.solve(trial.with_accuracy(accuracy).problem)
            near = nearest_path(trial, run, accuracy, solve)
            path = ", ".join(["jump"] * jumps + [f"strengths {near.path}"] * (near.path > 0))
            back = "load {:.2%}, field {:.2%}".format(*apart(trial, run, turning)) if jumps else ""
            yield (
                f"| {trial.name} | {accuracy:.1%} | {run.steps} | {run.seconds:.1f} | {near.curve:.2%} | "
                f"{near.field:.2%} | {peak_difference(run, near.limit):+.2%} | {run.quasi_static_error:.2%} | "
                f"{path} | {back} |"
            )


def _kept(limits: dict[str, Solution], reference: Engine, trial: Trial) -> Solution:
    """The solution of a trial by the reference, solved once."""
    if trial.name not in limits:
        limits[trial.name] = reference.solve(trial.problem)
    return limits[trial.name]


def tolerance_rows(trials: Sequence[Trial]) -> Iterator[str]:
    """The equilibrium engine against itself, ten times tighter and without condensation."""
    yield "| specimen | particles | increments | seconds | load | field | energy error | whole, tighter |"
    yield "|---|---|---|---|---|---|---|---|"
    for trial in trials:
        run = equilibrium.solve(trial.problem)
        limit = equilibrium.solve(trial.problem, tolerance=TIGHTER * equilibrium.TOLERANCE, condensed=False)
        curve, field = apart(trial, run, limit)
        yield (
            f"| {trial.name} | {trial.problem.particles.count} | {run.steps} | {run.seconds:.1f} | {curve:.2%} | "
            f"{field:.2%} | {run.energy.error:.0e} | {limit.seconds:.1f} s |"
        )


def size_rows(geometry: str, radii_mm: Sequence[float], seed: int = 1) -> Iterator[str]:
    """Time and memory of the equilibrium engine as particles get smaller, and the exponents of their growth.

    Memory is the largest this process has had so far: give radii from large to small.
    """
    yield "| specimen | particles | seconds | memory |"
    yield "|---|---|---|---|"
    counts, seconds = [], []
    for radius in radii_mm:
        trial = section_trial(geometry, radius, seed)
        run = equilibrium.solve(trial.problem)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        counts.append(trial.problem.particles.count)
        seconds.append(run.seconds)
        yield f"| {trial.name} | {counts[-1]} | {seconds[-1]:.1f} | {memory:.0f} MB |"
    if len(counts) > 1:
        exponent = np.polyfit(np.log(counts), np.log(seconds), 1)[0]
        yield f"| growth of the time with the number of particles | | power {exponent:.2f} | |"


def kinematics_rows(trials: Sequence[Trial]) -> Iterator[str]:
    """Finite against small kinematics by the equilibrium engine: what the choice changes."""
    yield "| specimen | load | field | peak |"
    yield "|---|---|---|---|"
    for trial in trials:
        finite = trial.with_kinematics(Kinematics.FINITE)
        runs = [equilibrium.solve(t.problem) for t in (finite, trial.with_kinematics(Kinematics.SMALL))]
        curve, field = apart(trial, *runs)
        yield f"| {trial.name} | {curve:.2%} | {field:.2%} | {peak_difference(*runs):+.2%} |"
