"""A study for a cluster: the simulations of an identification as a folder that runs without Python."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.errors import PipelineError, UnavailableError
from pipeline.execution.progress import Progress, Silent
from pipeline.hpc.folder import (
    VARIANTS,
    Job,
    begin_study,
    finish_study,
    refuse_another,
    stretch_of,
    write_points,
    write_scripts,
)
from pipeline.hpc.manifest import Manifest, Point, study_of
from pipeline.store.atomic import refused
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.problem_key import problem_key
from pipeline.study.assembly import settings_of
from pipeline.study.campaign import Campaign, first_grid, prepare

BUNDLE = "bundle"  # copy of the test in the study, so that it can be read back anywhere


def export(
    bundle: Path,
    out: Path,
    *,
    grid: tuple[float, ...] | None = None,
    objective: str | None = None,
    radius_mm: float | None = None,
    accuracy: float | None = None,
    ranks: int | None = None,
    partition: str | None = None,
    account: str | None = None,
    walltime_min: int | None = None,
    array_limit: int | None = None,
    restart_steps: int | None = None,
    stock: str | None = None,
    config: Path | None = None,
    progress: Progress | None = None,
) -> str:
    """Write the grid of an identification as decks, scripts and a copy of the bundle; OUT runs without Python.

    Parameters
    ----------
    bundle, out : folders
    stock : "table" or "plastic": bonds of LAMMPS stand in for ours, so that nothing has to be compiled
    the others : override the settings of `config`
    """
    options: dict[str, object] = {"grid": grid, "objective": objective, "radius_mm": radius_mm, "accuracy": accuracy}
    options |= {"ranks": ranks, "slurm_partition": partition, "slurm_account": account}
    options |= {"slurm_walltime_min": walltime_min, "slurm_array_limit": array_limit, "restart_steps": restart_steps}
    settings = settings_of(config, **options)
    if settings.engine != "lammps" or settings.levelling:
        raise UnavailableError("a study for a cluster is run by LAMMPS, without levelling: leave these settings out")
    out, told = Path(out), progress or Silent()
    read = read_bundle(bundle)
    with written_in(out):
        begin_study(out)
    variant = VARIANTS[stock or "cohesive"]
    campaign, nodes, points = planned(read, out, settings, variant.name, told)
    study = study_of([point.key for point in points])
    refuse_another(out, study)
    problems = [campaign.problem(*node) for node in nodes]
    stretch = stretch_of(out, settings.restart_steps, problems[0], settings.ranks)
    copy_bundle(read, campaign, out / BUNDLE)
    told.stage(f"{len(points)} decks")
    plain = settings.model_dump(mode="json", exclude_none=True)
    manifest = Manifest(
        study, __version__, read.name, variant.name, campaign.engine.label, plain, variant.versions, tuple(points)
    )
    with written_in(out):
        manifest = manifest.with_points(write_points(out, study, points, problems, variant, stretch))
        write_scripts(out, manifest, variant, job_of(settings), stretch)
        finish_study(out, manifest)
    return f"{len(points)} points of {problems[0].particles.count} particles; {out}/README.md says how to run them"


@contextmanager
def written_in(out: Path) -> Iterator[None]:
    """Turn an error of the file system into one that names the file, or at least OUT, and what to do."""
    try:
        yield
    except PipelineError:
        raise
    except OSError as error:
        raise refused(Path(error.filename or out), error) from error


def planned(
    read: Bundle, out: Path, settings: RunSettings, variant: str, progress: Progress
) -> tuple[Campaign, list[tuple[float, float]], list[Point]]:
    """The campaign of a bundle, the nodes of its first grid, and the points that stand for them."""
    campaign, _, _ = prepare(read, out, settings, progress)
    if variant != "cohesive":
        label = f"{campaign.engine.label}, stock approximation {variant}"
        campaign = replace(campaign, engine=replace(campaign.engine, label=label))
    nodes = first_grid(campaign).nodes()
    return campaign, nodes, points_of(campaign, nodes)


def points_of(campaign: Campaign, nodes: Sequence[tuple[float, float]]) -> list[Point]:
    """Points for nodes of a grid, numbered from 0."""
    keys = [problem_key(campaign.problem(*node), campaign.engine.label) for node in nodes]
    return [
        Point(k, float(f_max), float(delta_max), key)
        for k, ((f_max, delta_max), key) in enumerate(zip(nodes, keys, strict=True))
    ]


def job_of(settings: RunSettings) -> Job:
    """How SLURM is asked."""
    return Job(
        ranks=settings.ranks,
        walltime_min=settings.slurm_walltime_min,
        array_limit=settings.slurm_array_limit,
        partition=settings.slurm_partition,
        account=settings.slurm_account,
    )


def copy_bundle(read: Bundle, campaign: Campaign, folder: Path) -> None:
    """Copy what an identification reads of a test; measured fields stand in for speckle images.

    The test may be the copy itself, of a study that is exported again: the old copy goes when the new one is whole.

    Raises
    ------
    StoreError
        naming what cannot be written
    """
    sources = campaign.model.bundle.sources
    images, draft = bool(read.images), folder.with_name(f".{folder.name}.part")
    try:
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        for path in sorted(read.folder.iterdir()):
            if path.is_file() and path.name not in ("truth.json", "truth.h5", "frames.csv" if images else ""):
                shutil.copyfile(path, draft / path.name)
        if sources.fields is not None and sources.fields.resolve().parent != read.folder.resolve():
            shutil.copyfile(sources.fields, draft / "fields.h5")
        shutil.rmtree(folder, ignore_errors=True)
        draft.rename(folder)
    except OSError as error:
        raise refused(folder, error) from error
