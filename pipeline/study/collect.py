"""Reading an exported study back: what is whole is kept, what is not is named, and all of it is fitted."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from pipeline import __version__
from pipeline.config import run_settings
from pipeline.core.errors import StoreError
from pipeline.core.problem import Problem
from pipeline.execution.dask_workers import executor_of
from pipeline.execution.progress import Progress, Silent
from pipeline.hpc.folder import VARIANTS
from pipeline.hpc.manifest import Manifest, Point, read_manifest
from pipeline.hpc.points import Found, State, damaged_files, lammps_versions, look_at, solution_of
from pipeline.store.bundle import read_bundle
from pipeline.store.problem_key import problem_key
from pipeline.study.campaign import Campaign, first_grid, prepare, run_optimum, search
from pipeline.study.engines import Engine
from pipeline.study.export import BUNDLE
from pipeline.study.identify import conclude
from pipeline.study.widening import widening


def collect(out: Path, *, workers: int | None = None, dask: str | None = None, progress: Progress | None = None) -> str:
    """Read the points of an exported study, and fit as `identify` does; results lie in the study's folder.

    Simulations that the fit wants beyond the exported ones (a grid that moves, the optimum) run here.

    Parameters
    ----------
    out : Path; the study
    workers, dask : where simulations run that are wanted beyond the exported ones

    Raises
    ------
    StoreError
        naming every point that is missing or damaged; those that are whole are kept
    """
    started, told = time.monotonic(), progress or Silent()
    manifest = read_manifest(out)
    if wrong := damaged_files(out, manifest):
        raise StoreError("\n".join(f"{out}: {text}: copy it from where it was exported" for text in wrong))
    settings = run_settings(manifest.settings | {"workers": workers, "dask": dask, "ranks": 1}, "manifest.json")
    with executor_of(settings.dask) as executor:
        campaign, aim, folder = prepare(read_bundle(Path(out) / BUNDLE), out, settings, told, executor)
        solve = VARIANTS[manifest.variant].solve or campaign.engine.solve
        campaign = replace(campaign, engine=Engine(manifest.engine, solve))
        keep_points(campaign, out, manifest)
        found = search(campaign, aim)
        problem, optimum = run_optimum(campaign, found)
        more = widening(campaign, found)
    model = replace(campaign.model, remarks=(*campaign.model.remarks, *remarks(out, manifest)))
    seconds = time.monotonic() - started
    return conclude(replace(campaign, model=model), folder, found, problem, optimum, seconds, more)


def keep_points(campaign: Campaign, out: Path, manifest: Manifest) -> None:
    """Put the simulations of all points that are whole into the store.

    Raises
    ------
    StoreError
        naming those that are not
    """
    problems = problems_of(campaign, manifest)
    campaign.progress.begin(len(problems), 0, "point")
    wrong = []
    for point, problem in zip(manifest.points, problems, strict=True):
        found = keep_point(campaign, Path(out), manifest, point, problem)
        if found is None:
            campaign.progress.done(point.folder)
        else:
            wrong.append(found)
    if wrong:
        count = len(problems) - len(wrong)
        head = f"{count} of {len(problems)} points are whole and kept; the fit needs them all"
        raise StoreError("\n".join([head, *map(str, wrong)]))


def keep_point(campaign: Campaign, out: Path, manifest: Manifest, point: Point, problem: Problem) -> Found | None:
    """Put one simulation into the store, unless it lies there; what is wrong with it, if anything."""
    if point.key in campaign.store:
        return None
    found = look_at(out, point)
    if found.state is not State.DONE:
        return found
    try:
        campaign.store.put(point.key, solution_of(out, manifest, point, problem))
    except (OSError, RuntimeError, ValueError) as error:
        return Found(point, State.DAMAGED, str(error))
    return None


def problems_of(campaign: Campaign, manifest: Manifest) -> list[Problem]:
    """The problems of all points, which must be those that were exported.

    Raises
    ------
    StoreError
        where the model of this version is not that of the exported decks
    """
    problems = [campaign.problem(point.f_max_n, point.delta_max_m) for point in manifest.points]
    keys = [problem_key(problem, manifest.engine) for problem in problems]
    if keys != [point.key for point in manifest.points] or len(problems) < len(first_grid(campaign).nodes()):
        raise StoreError(
            f"the decks were exported by version {manifest.version}, and this version ({__version__}) makes other "
            "ones of the same test: collect with the version that exported, or export again"
        )
    return problems


def remarks(out: Path, manifest: Manifest) -> tuple[str, ...]:
    """What to know of how the points were run."""
    ran = sorted(lammps_versions(out, manifest))
    told = f"{len(manifest.points)} points were run elsewhere by LAMMPS {', '.join(ran) or 'of an unknown version'}"
    if manifest.variant == "cohesive":
        return (told,)
    return (
        told,
        f"bonds were those of the stock approximation {manifest.variant!r}: what that costs is in docs/stock.md",
    )
