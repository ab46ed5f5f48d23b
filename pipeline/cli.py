"""The command line: each command reads its options, calls one function of `study` and says where the result lies.

Everything that computes is imported inside the commands, so that `--help` is quick.
"""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from pipeline.cli_blind_check import blind_check
from pipeline.cli_cluster import collect, export
from pipeline.cli_diagnose import diagnose
from pipeline.cli_library import library
from pipeline.options import (
    Accuracy,
    Bundle,
    CameraScale,
    CmodRate,
    Config,
    Dask,
    Debug,
    DeltaMax,
    Effect,
    EngineChoice,
    Fields,
    FMax,
    Frames,
    Geometry,
    Grid,
    LawChoice,
    LoadNoise,
    NoiseGrey,
    NoisePx,
    ObjectiveChoice,
    Out,
    Placements,
    Radius,
    Ranks,
    Record,
    Scale,
    Seed,
    Start,
    Step,
    Subset,
    Temperature,
    Times,
    TrueDeltaMax,
    TrueFMax,
    Version,
    Workers,
    option,
)
from pipeline.terminal import Display, exit_codes, finish

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
app.add_typer(library, name="library")
app.add_typer(blind_check, name="blind-check")
app.command()(diagnose)
app.command()(export)
app.command()(collect)


@app.callback()
def common(
    version: Version = False,
) -> None:
    """Cohesive fracture properties of asphalt and concrete from images of a fracture test."""


@app.command()
def new(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to make.")],
    geometry: Annotated[Geometry, option("--geometry", help="Specimen.")],
    record: Record = None,
    cmod_rate_mm_per_min: CmodRate = None,
    debug: Debug = False,
) -> None:
    """Make an experiment bundle to fill in."""
    with exit_codes(debug):
        from pipeline.study.new import new as make

        finish(make(folder, geometry, record, cmod_rate_mm_per_min), folder)


@app.command()
def check(bundle: Bundle, debug: Debug = False) -> None:
    """Validate a bundle and list every problem at once."""
    with exit_codes(debug):
        from pipeline.study.check import check as validate

        finish(validate(bundle), bundle)


@app.command()
def model(
    bundle: Bundle,
    out: Out,
    radius_mm: Radius = None,
    config: Config = None,
    workers: Workers = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Build the bonded-particle model of a specimen, and draw it."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.model import model as build

            summary = build(bundle, out, radius_mm=radius_mm, config=config, progress=progress)
        finish(summary, out)


@app.command()
def dic(
    bundle: Bundle,
    out: Out,
    subset: Subset = None,
    step: Step = None,
    config: Config = None,
    workers: Workers = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Measure displacements, crack path and opening in a test's speckle images."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.dic import dic as correlate

            summary = correlate(
                bundle, out, subset_px=subset, step_px=step, config=config, workers=workers, progress=progress
            )
        finish(summary, out)


@app.command()
def simulate(
    bundle: Bundle,
    out: Out,
    f_max: FMax,
    delta_max: DeltaMax,
    engine: EngineChoice = None,
    radius_mm: Radius = None,
    accuracy: Accuracy = None,
    law: LawChoice = None,
    effect: Effect = None,
    config: Config = None,
    workers: Workers = None,
    ranks: Ranks = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Simulate one fracture test."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.simulate import simulate as run

            summary = run(
                bundle,
                out,
                f_max=f_max,
                delta_max=delta_max,
                engine=engine,
                radius_mm=radius_mm,
                accuracy=accuracy,
                effect=effect,
                ranks=ranks,
                law=law,
                config=config,
                progress=progress,
            )
        finish(summary, out)


@app.command()
def identify(
    bundle: Bundle,
    out: Out,
    engine: EngineChoice = None,
    grid: Grid = None,
    objective: ObjectiveChoice = None,
    radius_mm: Radius = None,
    accuracy: Accuracy = None,
    fields: Fields = None,
    viscoelastic: Annotated[bool, option("--viscoelastic", help="Let the mastic creep.")] = False,
    levelling: Annotated[
        bool, option("--levelling", help="Correlate simulated fields as the measured ones were.")
    ] = False,
    placements: Placements = None,
    config: Config = None,
    workers: Workers = None,
    ranks: Ranks = None,
    dask: Dask = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Estimate f_max and delta_max of the mastic from a test."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.identify import identify as estimate

            summary = estimate(
                bundle,
                out,
                engine=engine,
                grid=grid,
                objective=objective,
                radius_mm=radius_mm,
                accuracy=accuracy,
                fields=fields,
                levelling=levelling or None,
                placements=placements,
                viscoelastic=viscoelastic or None,
                config=config,
                workers=workers,
                ranks=ranks,
                dask=dask,
                seed=seed,
                progress=progress,
            )
        finish(summary, out)


@app.command()
def creep(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Creep compliance, units in the column titles.")],
    out: Out,
    temperature_c: Temperature = None,
    times: Times = None,
    workers: Workers = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Turn creep compliance into a Burgers model and its relaxation modulus."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.creep import creep as fit

            summary = fit(file, out, temperature_c=temperature_c, window=times, progress=progress)
        finish(summary, out)


@app.command("cross-check")
def cross_check(
    out: Out,
    full: Annotated[bool, option("--full", help="Finer specimens, more sections and orientations: an hour.")] = False,
    workers: Workers = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Compare the engines with each other and with closed forms."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.cross_check import cross_check as compare

            summary = compare(out, full=full, workers=workers, seed=seed, progress=progress)
        finish(summary, out)


@app.command("virtual-test")
def virtual_test(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Bundle to make.")],
    geometry: Annotated[Geometry | None, option("--geometry", help="Specimen; seb unless --like says other.")] = None,
    specimen: Annotated[Path | None, option("--specimen", metavar="IMAGE", help="Photograph or label image.")] = None,
    like: Annotated[Path | None, option("--like", metavar="BUNDLE", help="Bundle whose test is imitated.")] = None,
    creep: Annotated[
        Path | None, option("--creep", metavar="FILE", help="The mastic creeps as this record says.")
    ] = None,
    f_max: TrueFMax = None,
    delta_max: TrueDeltaMax = None,
    start: Start = None,
    radius_mm: Radius = None,
    mm_per_px: Scale = None,
    effect: Effect = None,
    images: Annotated[bool, option("--images", help="Speckle images instead of displacement fields.")] = False,
    noise_px: NoisePx = None,
    noise_grey: NoiseGrey = None,
    camera_mm_per_px: CameraScale = None,
    frames: Frames = None,
    load_noise_n: LoadNoise = 5.0,
    config: Config = None,
    workers: Workers = None,
    seed: Seed = None,
    debug: Debug = False,
) -> None:
    """Make a bundle with known truth by another kind of model."""
    with exit_codes(debug):
        with Display() as progress:
            from pipeline.study.output import virtual_test_folder
            from pipeline.study.virtual_test import virtual_test as make

            with virtual_test_folder(out):
                summary = make(
                    out,
                    geometry=geometry,
                    specimen=specimen,
                    like=like,
                    creep=creep,
                    f_max=f_max,
                    delta_max=delta_max,
                    start=start,
                    radius_mm=radius_mm,
                    mm_per_px=mm_per_px,
                    images=images,
                    noise_px=noise_px,
                    noise_grey=noise_grey,
                    camera_mm_per_px=camera_mm_per_px,
                    frames=frames,
                    effect=effect,
                    workers=workers,
                    load_noise_n=load_noise_n,
                    config=config,
                    seed=seed,
                    progress=progress,
                )
        finish(summary, out)


def main() -> None:
    """The command `cohesive-bpm`."""
    try:
        app(prog_name="cohesive-bpm")
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what comes now would only turn a result into a failure
