"""How a blind check diagnoses: as `diagnose` does, but without pictures, and sharing simulations between tests."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.config import RunSettings
from pipeline.core.errors import PipelineError
from pipeline.core.units import MM
from pipeline.execution.here import Here
from pipeline.execution.progress import Progress, Silent
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.problem_key import problem_key
from pipeline.store.start import start_parameters
from pipeline.study.assembly import build_model, settings_of
from pipeline.study.blind_check.looks import LOOKS, STRIPS, Look, write_look
from pipeline.study.blind_check.seal import read_json
from pipeline.study.diagnose import diagnose as diagnose_tests
from pipeline.study.diagnose_case import Case, prepared
from pipeline.study.diagnose_sight import abscissae_about, seen
from pipeline.study.dic import FOLDER as DIC_FOLDER
from pipeline.study.dic import measured_fields, with_measured_fields
from pipeline.study.effects import Band

log = logging.getLogger("pipeline.study")

SOME = 0.1 * MM  # CMOD of the problem by which models are told apart


def look(
    bundles: Sequence[Path], out: Path, *, without: Sequence[str] = (), seed: int | None = None,
    workers: int | None = None,
) -> str:  # fmt: skip
    """Correlate images and find cracks: what tests of one specimen will share; keeps it in `out`/looks.

    Arguments as of `diagnose`, most of which do not matter here. A bundle that cannot be looked at is left out.
    """
    for path in bundles:
        if (out / LOOKS / f"{path.name}.json").exists():
            continue
        try:
            write_look(out, look_of(with_fields(read_bundle(path), settings_of(None, workers=1), Silent())))
        except PipelineError as error:
            log.warning("%s: %s", path.name, error)
    return f"{len(bundles)} bundles looked at"


def look_of(bundle: Bundle) -> Look:
    """One bundle, with fields, before it is diagnosed."""
    model, view = build_model(bundle), seen(bundle)
    f_max, delta_max = start_parameters(bundle)
    problem = model.problem(f_max, delta_max, frames=np.array([SOME]), cmod_max=SOME)
    sight = view.observation.sight
    return Look(bundle.folder.name, problem_key(problem, ""), view.path, sight.peak_cmod, float(sight.cmod[-1]))


def with_fields(bundle: Bundle, settings: RunSettings, progress: Progress) -> Bundle:
    """The bundle with the fields of its images, which are kept in OUT/looks/NAME."""
    if not bundle.images:
        return bundle
    folder = bundle.folder.parents[1] / LOOKS / bundle.folder.name / DIC_FOLDER
    return with_measured_fields(bundle, measured_fields(bundle, folder, settings, progress, page=False))


def diagnose(
    bundles: Sequence[Path], out: Path, *, without: Sequence[str] = (), seed: int | None = None,
    workers: int | None = None,
) -> str:  # fmt: skip
    """Diagnose one bundle of a check, or several together; arguments as of `study.diagnose.diagnose`."""
    return diagnose_tests(bundles, out, without=without, seed=seed, workers=1, prepare=prepared_alike, page=False)


def prepared_alike(bundle: Bundle, folder: Path, engine: str, settings: RunSettings, progress: Progress) -> Case:
    """The test prepared, with the strip and the CMOD values that it shares with others of its specimen.

    Which points are too near the crack, and on which flank the others lie, its own path says.
    """
    bundle = with_fields(bundle, settings, progress)
    case = prepared(bundle, folder, engine, settings, progress, Here())
    shared = bundle.folder.parents[1] / STRIPS
    row = read_json(shared).get(bundle.folder.name) if shared.exists() else None
    if row is None:
        return case
    band, kept = case.band, abscissae_about(row["peak_m"], row["last_m"])
    if row["path_m"] is not None:
        band = Band(np.array(row["path_m"]), band.half)
    simulator = replace(case.simulator, band=band, abscissae=kept)
    return replace(case, look=replace(case.look, abscissae=kept), band=band, simulator=simulator)
