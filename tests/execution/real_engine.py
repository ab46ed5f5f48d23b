"""Real simulations that can be killed: `python -m execution.real_engine FOLDER COUNT` runs them into FOLDER/kept.

Every start of a simulation leaves a file KEY.PID.TIME in FOLDER/starts.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from helpers.beams import small_beam

from pipeline.core.problem import Problem, Solution
from pipeline.execution.simulations import run_all
from pipeline.lmp.ranks import solve_on_ranks
from pipeline.store.problem_key import problem_key
from pipeline.store.simulation import SimulationStore


def problems(count: int) -> dict[str, Problem]:
    """Small beams of different strength, by key."""
    beam = small_beam(2e-3, accuracy=0.002)
    laws = [replace(beam.law, f_max=factor * beam.law.f_max) for factor in np.linspace(0.9, 1.1, count)]
    return {problem_key(problem, "kills"): problem for problem in map(beam.with_law, laws)}


def simulate(folder: Path, problem: Problem) -> Solution:
    """One simulation in LAMMPS under the launcher of MPI, told by a file."""
    key = problem_key(problem, "kills")
    (folder / "starts" / f"{key}.{os.getpid()}.{time.time_ns()}").touch()
    return solve_on_ranks(problem, 1)


def command(folder: Path, count: int) -> None:
    """Run what is not kept, on two workers."""
    (folder / "starts").mkdir(parents=True, exist_ok=True)
    run_all(partial(simulate, folder), problems(count), SimulationStore(folder / "kept"), workers=2)


if __name__ == "__main__":
    command(Path(sys.argv[1]), int(sys.argv[2]))
