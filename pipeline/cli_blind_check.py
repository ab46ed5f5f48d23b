"""The commands `cohesive-bpm blind-check …`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from pipeline.options import Debug, Out, Seed, Workers, option
from pipeline.terminal import Display, exit_codes, finish

blind_check = typer.Typer(no_args_is_help=True, help="The sealed test of diagnose: make, run, open.")

Size = Annotated[Literal["small", "full"], option("--size", help="small: minutes; full: an hour or more.")]
Limits = Annotated[
    Path | None, option("--limits", metavar="FILE", help="result.json of a diagnosis: detection limits to scale by.")
]
Truth = Annotated[Path | None, option("--truth", metavar="FILE", help="Truth table of another program.")]


@blind_check.command()
def make(
    out: Out,
    size: Size = "small",
    limits: Limits = None,
    workers: Workers = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Break tests with another engine and seal them, their truth locked beside OUT."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.blind_check.make import make as seal

            cores = workers or os.cpu_count() or 1
            summary = seal(out, size=size, seed=seed or 0, limits=limits, workers=cores, progress=progress)
        finish(summary, out)


@blind_check.command()
def run(out: Out, workers: Workers = None, seed: Seed = None, debug: Debug = False) -> None:
    """Diagnose every sealed bundle, then seal the verdicts."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.blind_check.run import run as judge

            summary = judge(out, seed=seed or 0, workers=workers or os.cpu_count() or 1, progress=progress)
        finish(summary, out)


@blind_check.command("open")
def open_(out: Out, truth: Truth = None, debug: Debug = False) -> None:
    """Check the seals, open the truth and score the verdicts."""
    with exit_codes(debug):
        from pipeline.study.blind_check.opening import open_check

        finish(open_check(out, truth=truth), out)
