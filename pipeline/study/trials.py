"""Trials of the whole chain against known truth, as tables for the documentation."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.units import MM
from pipeline.execution.progress import Progress, Silent
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import read_bundle
from pipeline.store.new import Contents, write_bundle
from pipeline.store.results import read_result
from pipeline.study.assembly import build_model
from pipeline.study.engines import engine
from pipeline.study.filming import Clock
from pipeline.study.identify import identify
from pipeline.study.request import Request
from pipeline.study.truth import draw_truth, made_already
from pipeline.study.virtual_test import prepare, recording_of, virtual_test, with_noise
from pipeline.twin.virtual_test import exact_record, noisy_record


@dataclass(frozen=True)
class Trial:
    """One virtual test identified.

    Parameters
    ----------
    name : str
    f_max, delta_max, energy : float; estimate over truth
    paper : (f_max, delta_max) of the paper's multinomial, over the truth
    inside_f, inside_delta : bool; whether the 95 % interval holds the truth
    interior : bool
    peak_mismatch : float; simulated over measured peak load, minus one
    seconds : float; of the identification
    """

    name: str
    f_max: float
    delta_max: float
    energy: float
    paper: tuple[float, float]
    inside_f: bool
    inside_delta: bool
    interior: bool
    peak_mismatch: float
    seconds: float


def twin_trial(
    folder: Path,
    seed: int,
    objective: str,
    progress: Progress | None = None,
    *,
    config: Path | None = None,
    **how: Any,
) -> Trial:
    """Make the virtual test of a seed, unless it is there, and identify it.

    Parameters
    ----------
    folder : where bundles and results are kept; a second call goes on from there
    seed : of section, network, truth and noise
    objective : as of `identify`
    config : settings of `identify`
    how : radius_mm and others of `virtual_test`
    """
    bundle, out = folder / f"twin-{seed}", folder / f"identified-{seed}-{objective}"
    if not made_already(bundle):
        virtual_test(bundle, seed=seed, progress=progress, **how)
    return _identified(bundle, out, seed, objective, config, progress)


def same_lattice_trial(
    folder: Path,
    seed: int,
    objective: str,
    progress: Progress | None = None,
    *,
    config: Path | None = None,
    **how: Any,
) -> Trial:
    """Identify a test that was broken on the identifying lattice itself: noise and interpolation are what remains.

    The lattice lies where the test has it, so no other placements are averaged.

    Parameters
    ----------
    folder, seed, objective, config, how : as of `twin_trial`
    """
    name = f"same-{seed}"
    bundle, out = folder / name, folder / f"identified-{name}-{objective}"
    if not (bundle / "truth.json").is_file():
        same_lattice_test(bundle, seed, Request(**how), progress or Silent())
    return _identified(bundle, out, seed, objective, config, progress, placements=0)


def same_lattice_test(out: Path, seed: int, request: Request, progress: Progress) -> None:
    """A bundle like that of a virtual test, but of the model that identifies it, solved by LAMMPS."""
    of_section, of_truth, of_noise = np.random.default_rng(seed).spawn(3)
    experiment, images = prepare(request, out.name, of_section)
    write_bundle(out, experiment, images)
    bundle = read_bundle(out)
    truth, recording = draw_truth(request, bundle, of_truth), recording_of(bundle, request, Clock())
    frames = recording.frame_cmod[recording.frame_cmod > 0]
    problem = build_model(bundle).problem(
        truth.f_max, truth.delta_max, frames=frames, cmod_max=recording.cmod_max * (1 + 1e-6)
    )
    progress.stage("breaking it")
    solution = engine("lammps").solve(problem)
    curve, field = noisy_record(*exact_record(problem, solution, recording), recording, of_noise)
    write_bundle(out, with_noise(experiment, request), Contents(curve, field))
    known = {"f_max_n": truth.f_max, "delta_max_m": truth.delta_max, "radius_mm": truth.radius / MM}
    write_atomically(out / "truth.json", json.dumps(known).encode())


def _identified(
    bundle: Path,
    out: Path,
    seed: int,
    objective: str,
    config: Path | None,
    progress: Progress | None,
    placements: int | None = None,
) -> Trial:
    identify(bundle, out, objective=objective, config=config, progress=progress, placements=placements)
    return compare(f"seed {seed}", json.loads((bundle / "truth.json").read_text("utf-8")), read_result(out))


def compare(name: str, truth: dict[str, Any], result: dict[str, Any]) -> Trial:
    """An identification against the truth."""
    f_max, delta_max = result["f_max_n"] / truth["f_max_n"], result["delta_max_m"] / truth["delta_max_m"]
    interval = result["interval_95"] or {"f_max_n": (np.nan, np.nan), "delta_max_m": (np.nan, np.nan)}
    inside = {key: bool(low <= truth[key] <= high) for key, (low, high) in interval.items()}
    return Trial(
        name,
        f_max,
        delta_max,
        f_max * delta_max,
        (result["paper"]["f_max_n"] / truth["f_max_n"], result["paper"]["delta_max_m"] / truth["delta_max_m"]),
        inside["f_max_n"],
        inside["delta_max_m"],
        result["interior"],
        result["peak_load_mismatch"],
        result["seconds"],
    )


def trial_table(trials: Sequence[Trial]) -> str:
    """Trials as a Markdown table; at its foot medians, the worst and geometric means with their standard errors."""
    rows = [
        "| test | f_max | delta_max | G_f | truth in interval (f_max, delta_max) | peak load | seconds "
        "| f_max, delta_max by the paper's multinomial |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for t in trials:
        inside = f"{_yes(t.inside_f)}, {_yes(t.inside_delta)}"
        rows.append(
            f"| {t.name} | {_off(t.f_max)} | {_off(t.delta_max)} | {_off(t.energy)} | {inside} | "
            f"{t.peak_mismatch:+.1%} | {t.seconds:.0f} | {_off(t.paper[0])}, {_off(t.paper[1])} |"
        )
    ratios = np.array([(t.f_max, t.delta_max, t.energy, *t.paper) for t in trials])
    for name, of in (("median", np.median), ("worst", worst)):
        *ours, paper_f, paper_delta = (_off(ratio) for ratio in of(ratios, axis=0))
        rows.append(f"| **{name}** | {' | '.join(ours)} | | | | {paper_f}, {paper_delta} |")
    if len(trials) > 1:
        rows.append(f"| **geometric mean ± standard error** | {' | '.join(_means(ratios[:, :3]))} | | | | |")
    inside_f, inside_d = (sum(getattr(t, k) for t in trials) for k in ("inside_f", "inside_delta"))
    rows.append(f"| **truth inside** | {inside_f} of {len(trials)} | {inside_d} of {len(trials)} | | | | | |")
    return "\n".join(rows) + "\n"


def worst(ratios: np.ndarray, axis: int = 0) -> np.ndarray:
    """The ratio furthest from one of each column."""
    return np.take_along_axis(ratios, np.argmax(np.abs(ratios - 1), axis, keepdims=True), axis)[0]


def _means(ratios: np.ndarray) -> list[str]:
    """Geometric mean and its standard error of each column, for factors are what is looked for."""
    logs = np.log(ratios)
    errors = logs.std(axis=0, ddof=1) / np.sqrt(len(logs))
    return [f"{_off(float(np.exp(mean)))} ± {error:.1%}" for mean, error in zip(logs.mean(axis=0), errors, strict=True)]


def _off(ratio: float) -> str:
    return f"{ratio - 1:+.1%}"


def _yes(inside: bool) -> str:
    return "yes" if inside else "no"
