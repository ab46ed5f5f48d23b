"""Points of a study as a cluster has left them: done, under way, damaged."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from pipeline.core.errors import PipelineError
from pipeline.core.problem import Problem, Solution
from pipeline.hpc.checksums import changed, read_checksum_list, sha256
from pipeline.hpc.folder import INPUTS, VARIANTS
from pipeline.hpc.manifest import Manifest, Point

RESULTS = "results.sha256"


class State(StrEnum):
    """How far a point has come."""

    DONE = "done"
    MISSING = "missing"
    UNFINISHED = "not finished"
    DAMAGED = "damaged"


@dataclass(frozen=True)
class Found:
    """What lies in the folder of a point.

    Parameters
    ----------
    point : Point
    state : State
    reason : str; why it is not done, and what to do
    """

    point: Point
    state: State
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.point.folder} is {self.state}: {self.reason}"


def damaged_files(study: Path, manifest: Manifest) -> list[str]:
    """What is wrong with files that belong to no point."""
    return changed(study, manifest.files)


def look_at(study: Path, point: Point) -> Found:
    """How far a point has come, and whether its files are those that were exported and that its run has left."""
    folder, again = study / point.folder, f"run point {point.number} again"
    if not folder.is_dir():
        return Found(point, State.MISSING, "its folder is not there; copy it back")
    if not (folder / INPUTS).is_file() or sha256(folder / INPUTS) != point.inputs:
        return Found(point, State.DAMAGED, f"its {INPUTS} is of another study or was changed; export again")
    if wrong := changed(folder, read_checksum_list((folder / INPUTS).read_text(errors="replace"))):
        return Found(point, State.DAMAGED, f"{wrong[0]}; export again, and {again}")
    if not (folder / RESULTS).is_file():
        if (folder / "curve.txt").is_file():
            return Found(point, State.UNFINISHED, f"it was stopped, or is under way; unless it is, {again}")
        return Found(point, State.MISSING, f"it was never run; {again}")
    return _results_of(folder, point, again)


def _results_of(folder: Path, point: Point, again: str) -> Found:
    listed = read_checksum_list((folder / RESULTS).read_text(errors="replace"))
    if listed.get(INPUTS) != point.inputs:
        return Found(point, State.DAMAGED, f"its results were made from other inputs; {again}")
    lacking = [name for name in ("curve.txt", "frames.dump", "bonds.dump") if name not in listed]
    wrong = [f"{name} is not listed" for name in lacking] + changed(folder, listed)
    return Found(point, State.DAMAGED, f"{wrong[0]}; {again}") if wrong else Found(point, State.DONE)


def solution_of(study: Path, manifest: Manifest, point: Point, problem: Problem) -> Solution:
    """The solution of a point that is done.

    Raises
    ------
    PipelineError
        naming the file that cannot be read as this problem's
    """
    try:
        return VARIANTS[manifest.variant].read(problem, study / point.folder, 0.0)
    except (OSError, ValueError, IndexError) as error:
        raise PipelineError(f"{point.folder} cannot be read ({error}): run point {point.number} again") from error


def lammps_versions(study: Path, manifest: Manifest) -> set[str]:
    """What the LAMMPS that ran the points called itself, from their logs."""
    found = set()
    for point in manifest.points:
        for log in (study / point.folder).glob("log-*.lammps"):
            with log.open(errors="replace") as lines:
                found |= set(re.findall(r"^LAMMPS \((.*?)\)", lines.readline()))
    return found
