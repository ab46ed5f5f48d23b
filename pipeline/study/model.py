"""The bonded-particle model of a bundle's specimen, as numbers, picture and LAMMPS deck."""

from __future__ import annotations

import tempfile
from pathlib import Path

from pipeline import __version__
from pipeline.core.problem import Problem
from pipeline.core.units import MM
from pipeline.execution.progress import Progress, Silent
from pipeline.lmp.deck import write_deck
from pipeline.store.atomic import refused
from pipeline.store.bundle import read_bundle
from pipeline.store.results import prepare_output, write_result
from pipeline.store.start import start_parameters
from pipeline.study.assembly import build_model, settings_of
from pipeline.study.output import results_folder
from pipeline.study.pages import model_page

DEFAULT_CMOD_MAX = 0.55 * MM  # of a deck for a specimen whose test has no record yet


def model(
    bundle: Path,
    out: Path,
    *,
    radius_mm: float | None = None,
    config: Path | None = None,
    progress: Progress | None = None,
) -> str:
    """Build the model of a bundle's specimen; writes the LAMMPS folder, result.json, picture and report."""
    settings = settings_of(config, radius_mm=radius_mm)
    read = read_bundle(bundle)
    folder = results_folder(out, read)
    (progress or Silent()).stage("building the model")
    built = build_model(read, settings.radius)
    cmod_max = None if read.curve is not None or read.loading.cmod_max else DEFAULT_CMOD_MAX
    problem = built.problem(*start_parameters(read), accuracy=settings.accuracy, cmod_max=cmod_max)
    deck = place_deck(folder / "lammps", problem)
    report = built.report
    result = {
        "version": __version__,
        "command": "model",
        "bundle": read.name,
        "radius_mm": problem.particles.radius / MM,
        "particles": report.particles,
        "bonds": report.bonds,
        "stones": report.stones,
        "aggregate_fraction": report.aggregate_fraction,
        "void_particles": report.void,
        "left_out_particles": report.islands + report.loose,
        "bonds_by_phase": {phase.name.lower(): count for phase, count in report.bonds_by_phase},
        "remarks": list(built.remarks),
    }
    write_result(folder, result)
    model_page(folder, built, result)
    return f"{report.particles} particles, {report.bonds} bonds, {report.stones} stones; LAMMPS deck in {deck}"


def place_deck(folder: Path, problem: Problem) -> Path:
    """Write a LAMMPS folder; where that fails, an earlier deck in it stays as it was.

    Raises
    ------
    StoreError
        naming the folder, the reason and what to do
    """
    prepare_output(folder)
    try:
        with tempfile.TemporaryDirectory(dir=folder, prefix=".new-") as new:
            write_deck(Path(new), problem)
            for path in sorted(Path(new).iterdir()):
                path.replace(folder / path.name)
    except OSError as error:
        raise refused(folder, error) from error
    return folder
