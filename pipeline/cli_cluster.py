"""The commands that carry simulations to a cluster and back: `export` and `collect`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from pipeline.options import (
    Accuracy,
    Bundle,
    Config,
    Dask,
    Debug,
    Grid,
    ObjectiveChoice,
    Radius,
    Ranks,
    Workers,
    option,
)
from pipeline.terminal import Display, exit_codes, finish

Study = Annotated[Path, typer.Argument(metavar="OUT", help="Folder of the study.")]


def export(
    bundle: Bundle,
    out: Study,
    grid: Grid = None,
    objective: ObjectiveChoice = None,
    radius_mm: Radius = None,
    accuracy: Accuracy = None,
    ranks: Ranks = None,
    partition: Annotated[str | None, option("--partition", metavar="NAME", help="Partition of SLURM.")] = None,
    account: Annotated[str | None, option("--account", metavar="NAME", help="Account of SLURM.")] = None,
    walltime_min: Annotated[
        int | None, option("--walltime-min", metavar="T", min=1, help="Walltime of a point, in min (default: 60).")
    ] = None,
    array_limit: Annotated[int | None, option("--array-limit", metavar="N", min=1, help="Points at a time.")] = None,
    restart_steps: Annotated[
        int | None, option("--restart-steps", metavar="N", min=20, help="Steps between restart files.")
    ] = None,
    stock: Annotated[
        Literal["table", "plastic"] | None,
        option("--stock", help="Bonds of LAMMPS instead of ours: nothing to compile, less exact."),
    ] = None,
    config: Config = None,
    debug: Debug = False,
) -> None:
    """Write the simulations of an identification as a folder that runs on a cluster without Python."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.export import export as write

            summary = write(
                bundle,
                out,
                grid=grid,
                objective=objective,
                radius_mm=radius_mm,
                accuracy=accuracy,
                ranks=ranks,
                partition=partition,
                account=account,
                walltime_min=walltime_min,
                array_limit=array_limit,
                restart_steps=restart_steps,
                stock=stock,
                config=config,
                progress=progress,
            )
        finish(summary, out)


def collect(out: Study, workers: Workers = None, dask: Dask = None, debug: Debug = False) -> None:
    """Read an exported study back: name what is missing or damaged, fit when all of it is there."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.collect import collect as read

            summary = read(out, workers=workers, dask=dask, progress=progress)
        finish(summary, out)
