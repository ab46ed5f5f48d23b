"""One fracture test by LAMMPS: problem in, solution out."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, PipelineError, StoreError, ToolchainError
from pipeline.core.problem import EnergyBalance, Problem, Solution
from pipeline.explicit.frames import fields_at_stations
from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.output import read_curve, read_frames, read_reached
from pipeline.lmp.plugin import open_lammps

ROOM = "; make room there, raise its limits (ulimit -f), or let TMPDIR name another folder"
ENERGIES = ("external", "stored", "dissipated", "kinetic", "damping")


def solve(problem: Problem, folder: Path | None = None) -> Solution:
    """Run the problem through LAMMPS in this process.

    Parameters
    ----------
    problem : Problem
    folder : where deck and output are kept; a temporary folder by default

    Raises
    ------
    ConvergenceError
        if the gauge did not reach cmod_max
    StoreError
        if a file cannot be written or is cut off
    ToolchainError
        if LAMMPS or the compiled style is missing
    """
    return in_folder(folder, lambda place: _solve_in(problem, place))


def in_folder(folder: Path | None, solve_in: Callable[[Path], Solution]) -> Solution:
    """Solve in a folder that is made, or in a temporary one; errors of files become errors of the package."""
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            return solve_in(folder)
        with tempfile.TemporaryDirectory(prefix="cohesive-bpm-") as temporary:
            return solve_in(Path(temporary))
    except StoreError:
        raise
    except FileNotFoundError as error:
        raise ToolchainError(f"{error.filename} does not exist: install the package again") from error
    except OSError as error:
        place = folder or tempfile.gettempdir()
        raise StoreError(f"the files of a simulation cannot be written in {place}: {error.strerror}{ROOM}") from error


def _solve_in(problem: Problem, folder: Path) -> Solution:
    start = time.process_time()
    write_deck(folder, problem)
    run(folder)
    return read_solution(problem, folder, time.process_time() - start)


def run(folder: Path) -> None:
    """Run the deck of a folder; LAMMPS writes its log and output there."""
    home = Path.cwd()
    instance = open_lammps(log=folder / "log.lammps")
    try:
        os.chdir(folder)
        instance.file(DECK)
    except Exception as error:
        remedy = ROOM if "Error writing" in str(error) else ""
        raise PipelineError(f"LAMMPS stopped in {folder}: {error}{remedy}") from error
    finally:
        os.chdir(home)
        instance.close()


def read_solution(problem: Problem, folder: Path, seconds: float) -> Solution:
    """The solution from the files that a finished run left in `folder`."""
    curve = read_curve(folder / "curve.txt")
    cmod = curve["cmod_m"]
    if cmod[-1] < problem.cmod_max:
        raise ConvergenceError(
            f"the gauge stopped at {cmod[-1] * 1e3:.4g} mm of {problem.cmod_max * 1e3:.4g} mm after "
            f"{curve['step'][-1]:.0f} steps: ask for less accuracy or a smaller cmod_max_mm"
        )
    frames = read_frames(folder / "frames.dump", problem.particles.count)
    stations, displacement = fields_at_stations(problem, frames)
    return Solution(
        curve=LoadCurve(cmod / problem.cmod_rate, cmod, curve["load_n"], curve["load_line_m"]),
        cmod=stations,
        displacement=displacement,
        reached=read_reached(folder / "bonds.dump", problem.bonds.pairs),
        energy=EnergyBalance(**{k: float(curve[f"{k}_j"][-1]) for k in ENERGIES}),
        quasi_static_error=float(curve["quasi_static_error"][-1]),
        steps=int(curve["step"][-1]),
        seconds=seconds,
        engine="lammps",
        converged=True,
        message=f"the gauge reached {problem.cmod_max * 1e3:.4g} mm",
    )
