"""The command `cohesive-bpm diagnose`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pipeline.options import Accuracy, Config, Debug, Engine, Out, Radius, Seed, Workers, factors, option
from pipeline.terminal import Display, exit_codes, finish


def diagnose(
    bundles: Annotated[list[Path], typer.Argument(metavar="BUNDLE", help="Folder of the experiment.")],
    out: Out,
    engine: Annotated[Engine | None, option("--engine", help="What simulates (default: equilibrium).")] = None,
    radius_mm: Radius = None,
    accuracy: Accuracy = None,
    grid: Annotated[
        Any,
        option("--grid", metavar="FACTORS", parser=factors, help="Of the start (default: 0.7,0.85,1,1.15,1.3)."),
    ] = None,
    without: Annotated[
        list[str] | None, option("--without", metavar="NAME", help="An effect left out of the library; repeatable.")
    ] = None,
    config: Config = None,
    workers: Workers = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Find where a test and its simulation part, which effect explains it, and how far that closes the gap."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.diagnose import diagnose as find

            summary = find(
                bundles,
                out,
                engine=engine,
                radius_mm=radius_mm,
                accuracy=accuracy,
                grid=grid,
                without=without or (),
                config=config,
                workers=workers,
                seed=seed,
                progress=progress,
            )
        finish(summary, out)
