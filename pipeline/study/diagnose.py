"""The sim-to-real gap of tests: where it lies, which effect explains it, how far that closes it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from pipeline.config import RunSettings
from pipeline.execution.progress import Progress, Silent
from pipeline.gap.diagnosis import FACTORS, Diagnosis
from pipeline.gap.diagnosis import diagnose as judge
from pipeline.gap.effects import effect, library
from pipeline.gap.library import nearest, shipped
from pipeline.gap.together import Together, together
from pipeline.gap.transfer import Test
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.layouts import DIAGNOSE
from pipeline.store.results import write_arrays, write_result
from pipeline.store.start import start_parameters
from pipeline.study.assembly import Model, settings_of
from pipeline.study.diagnose_arrays import diagnosis_arrays
from pipeline.study.diagnose_case import ENGINE, Case, prepared
from pipeline.study.diagnose_result import bond_area, diagnosis_result, sentence
from pipeline.study.diagnose_together import folders, sentence_together, together_result
from pipeline.study.output import joint_folder, results_folder

Prepare = Callable[[Bundle, Path, str, RunSettings, Progress], Case]


def diagnose(
    bundles: Sequence[Path],
    out: Path,
    *,
    engine: str | None = None,
    radius_mm: float | None = None,
    accuracy: float | None = None,
    grid: tuple[float, ...] | None = None,
    without: Sequence[str] = (),
    config: Path | None = None,
    workers: int | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
    prepare: Prepare = prepared,
    page: bool = True,
) -> str:
    """Diagnose the gap of one test, or of several together; writes result.json, results.h5, figures, report.

    Finished simulations are kept in OUT/simulations: the same call goes on where it stopped. With several bundles each
    has its own results in a folder of OUT; what they say together stands in OUT.

    Parameters
    ----------
    bundles : folders; several are replicates, or transfer tests where geometry, rate or temperature differ
    out : folder
    grid : factors of the start, wider by default than those of an identification
    without : effects left out of the library
    prepare : makes a bundle ready
    page : whether figures and report.html are made
    the others : override the settings of `config`
    """
    options = {"radius_mm": radius_mm, "accuracy": accuracy, "workers": workers, "seed": seed}
    settings, chosen, progress = settings_of(config, **options), engine or ENGINE, progress or Silent()
    for name in without:
        effect(name)  # refuses what there is not
    names = [n for n in library() if n not in without]
    read = [read_bundle(path) for path in bundles]
    started = time.monotonic()
    if len(read) == 1:
        case = prepare(read[0], results_folder(out, read[0]), chosen, settings, progress)
        return sentence(judged(case, chosen, settings.seed, names, grid or FACTORS, started, page)[0])
    places = folders(read)
    folder = joint_folder(out, list(places))
    cases, found, warned = {}, [], {}
    for name, bundle in places.items():
        progress.stage(name)
        began = time.monotonic()
        cases[name] = prepare(bundle, results_folder(folder / name, bundle), chosen, settings, progress)
        diagnosis, warned[name] = judged(cases[name], chosen, settings.seed, names, grid or FACTORS, began, page)
        found.append(diagnosis)
    joint = together(
        [_test(name, case, d) for (name, case), d in zip(cases.items(), found, strict=True)],
        np.random.default_rng(settings.seed),
    )
    conclude(folder, cases, joint, warned, chosen, time.monotonic() - started, page)
    return sentence_together(joint)


def judged(
    case: Case,
    engine: str,
    seed: int,
    names: Sequence[str],
    grid: tuple[float, ...],
    started: float,
    page: bool = True,
) -> tuple[Diagnosis, list[str]]:
    """Diagnose one test and write its results; the clock stood at `started` (s) when work on it began.

    Returns
    -------
    the diagnosis, and what must be known before it is read
    """
    look, radius, geometry = case.look, case.model.particles.radius, case.bundle.specimen.geometry
    entry = nearest(shipped(), geometry, radius)
    warnings = [*entry.warnings(geometry, radius, look.observation), *unlearnt(case.model)]
    start, rng = start_parameters(case.bundle), np.random.default_rng(seed)
    diagnosis = judge(look.observation, look.abscissae, case.simulator, start, entry, rng, names, grid)
    result = diagnosis_result(case.bundle, look, diagnosis, warnings, radius)
    result |= {"seconds": time.monotonic() - started, "engine": engine}
    result["seconds_simulating"] = sum(case.simulator.spent)
    write_arrays(case.folder, DIAGNOSE, diagnosis_arrays(diagnosis, case.band.path))
    write_result(case.folder, result)
    if page:
        from pipeline.study.diagnose_page import diagnosis_page

        diagnosis_page(case, diagnosis, result)
    return diagnosis, result["warnings"]


def unlearnt(model: Model) -> list[str]:
    """Warns of a model of another kind than those that the library of discrepancies was learnt with."""
    found = []
    if model.mixture.shear_ratio:
        found.append(
            f"bonds carry shear at poissons_ratio = {model.mixture.poissons_ratio:g}; the library of discrepancies was "
            "learnt by a lattice whose bonds carry none: what models differ by may be larger here than the gate allows"
        )
    if model.phase_map is None:
        found.append(
            "the model is one material throughout; the library of discrepancies was learnt on specimens with stones: "
            "what honest models differ by is another thing here, in the load above all"
        )
    return found


def _test(name: str, case: Case, diagnosis: Diagnosis) -> Test:
    loading = case.bundle.loading
    condition = case.bundle.specimen.geometry, loading.cmod_rate, loading.temperature_c
    return Test(name, diagnosis, bond_area(case.bundle), condition, case.simulator)


def conclude(
    folder: Path,
    cases: dict[str, Case],
    joint: Together,
    warned: dict[str, list[str]],
    engine: str,
    seconds: float,
    page: bool = True,
) -> None:
    """Write what several tests say together."""
    result = together_result(cases, joint, warned) | {"seconds": seconds, "engine": engine}
    result["seconds_simulating"] = sum(sum(c.simulator.spent) for c in cases.values())
    write_result(folder, result)
    if page:
        from pipeline.study.diagnose_together_page import together_page

        together_page(folder, cases, joint, result)
