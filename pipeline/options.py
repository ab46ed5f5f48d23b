"""The options of the command line: what they are called, how they are read, which values are refused."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from pipeline import __version__

Geometry = Literal["seb", "dct"]
Engine = Literal["lammps", "equilibrium", "reference"]
Objective = Literal["fields", "load", "both"]


def positive(text: str) -> float:
    """A number above zero."""
    value = number(text)
    if not value > 0:
        raise typer.BadParameter(f"{text} must be above zero")
    return value


def not_negative(text: str) -> float:
    """A number that is zero or above."""
    value = number(text)
    if value < 0:
        raise typer.BadParameter(f"{text} must not be negative")
    return value


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise typer.BadParameter(f"{text!r} is not a number")
    return value


def bond_strength(text: str) -> float:
    """f_max in N, in the range of [start] f_max_n."""
    return _within(text, 1e-6, 1e7, "N")


def bond_opening(text: str) -> float:
    """delta_max in m, in the range of [start] delta_max_m."""
    return _within(text, 1e-8, 1e-2, "m")


def particle_radius(text: str) -> float:
    """A radius in mm, in the range of [model] particle_radius_mm."""
    return _within(text, 1e-3, 20, "mm")


def pixel_pitch(text: str) -> float:
    """A scale in mm, in the range of mm_per_px."""
    return _within(text, 1e-5, 10, "mm")


def pixel_noise(text: str) -> float:
    """A standard deviation in px: none, or one that a bundle can state."""
    return 0.0 if not_negative(text) == 0 else _within(text, 1e-5, 20, "px")


def grey_noise(text: str) -> float:
    """A standard deviation in grey values: none, or one that leaves something to be seen."""
    return 0.0 if not_negative(text) == 0 else _within(text, 1e-3, 100, "grey values")


def subset_size(text: str) -> int:
    """An odd number of pixels from 5 to 201."""
    if not text.isdecimal() or int(text) % 2 == 0 or not 5 <= int(text) <= 201:
        raise typer.BadParameter(f"{text!r} must be odd, 5 to 201: a subset has a centre")
    return int(text)


def load_noise(text: str) -> float:
    """A standard deviation in N: none, or in the range of [noise] load_std_n."""
    return 0.0 if not_negative(text) == 0 else _within(text, 1e-6, 1e7, "N")


def _within(text: str, low: float, high: float, unit: str) -> float:
    value = positive(text)
    if not low <= value <= high:
        raise typer.BadParameter(f"{text} lies outside {low:g} to {high:g} {unit}, the unit of this option")
    return value


def factors(text: str) -> tuple[float, ...]:
    """Numbers above zero, separated by commas, each larger than the one before."""
    values = tuple(positive(part) for part in text.split(","))
    if len(values) < 3 or any(b <= a for a, b in pairwise(values)):
        raise typer.BadParameter(f"{text!r} must be three or more increasing factors, as in 0.8,0.9,1,1.1,1.2")
    return values


def start_point(text: str) -> tuple[float, float]:
    """f_max in N and delta_max in m, separated by a comma."""
    parts = text.split(",")
    if len(parts) != 2:
        raise typer.BadParameter(f"{text!r} must be f_max in N and delta_max in m, as in 71,1.14e-4")
    return bond_strength(parts[0]), bond_opening(parts[1])


def celsius(text: str) -> float:
    """A temperature in °C, in the range of temperature_c."""
    value = number(text)
    if not -100 <= value <= 100:
        raise typer.BadParameter(f"{text} lies outside -100 to 100 °C, the unit of this option")
    return value


def time_span(text: str) -> tuple[float, float]:
    """Two increasing times in s, separated by a comma."""
    parts = [positive(part) for part in text.split(",")]
    if len(parts) != 2 or parts[0] >= parts[1]:
        raise typer.BadParameter(f"{text!r} must be two increasing times in s, as in 1,100")
    return parts[0], parts[1]


def temperature_range(text: str) -> tuple[float, float]:
    """Two temperatures in °C that do not fall, separated by a comma."""
    parts = [celsius(part) for part in text.split(",")]
    if len(parts) != 2 or parts[0] > parts[1]:
        raise typer.BadParameter(f"{text!r} must be two temperatures in °C, the colder one first, as in -20,-10")
    return parts[0], parts[1]


def named_number(text: str) -> tuple[str, float]:
    """NAME=VALUE."""
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise typer.BadParameter(f"{text!r} must be NAME=VALUE, as in fixture_compliance_um_per_kn=20")
    return name, number(value)


def show_version(wanted: bool) -> None:
    """Print the version and leave."""
    if wanted:
        print(__version__)
        raise typer.Exit


def option(*names: str, help: str, metavar: str | None = None, **more: Any) -> Any:
    """An option of a command."""
    return typer.Option(*names, help=help, metavar=metavar, **more)


Bundle = Annotated[Path, typer.Argument(metavar="BUNDLE", help="Folder of the experiment.")]
Out = Annotated[Path, option("-o", "--out", metavar="OUT", help="Folder for the results; a stopped run goes on in it.")]
Radius = Annotated[
    float | None,
    option(
        "--radius-mm",
        metavar="R",
        parser=particle_radius,
        help="Particle radius instead of the bundle's; f_max follows.",
    ),
]
# what is left out here has the value of --config, or else the default of the settings
Law = Literal["linear", "exponential", "bilinear-tail", "burgers"]
LawChoice = Annotated[
    Law | None, option("--law", help="Softening instead of the bundle's; burgers: the mastic creeps (creep.csv).")
]
EngineChoice = Annotated[Engine | None, option("--engine", help="What simulates (default: lammps).")]
Accuracy = Annotated[
    float | None,
    option("--accuracy", metavar="E", parser=positive, help="Quasi-static error asked for, relative (default: 0.01)."),
]
Placements = Annotated[
    int | None,
    option(
        "--placements",
        metavar="N",
        min=0,
        help="Other placements of the lattice, averaged at the optimum (default: 6).",
    ),
]
Fields = Annotated[Path | None, option("--fields", metavar="FILE", help="Displacement fields instead of the bundle's.")]
Config = Annotated[Path | None, option("--config", metavar="FILE", help="Settings of the run (TOML).")]
Workers = Annotated[
    int | None, option("--workers", metavar="N", min=1, help="Processes at a time; as many as processors.")
]
Dask = Annotated[
    str | None, option("--dask", metavar="tcp://HOST:PORT", help="Let the workers of this dask scheduler simulate.")
]
Ranks = Annotated[
    int | None, option("--ranks", metavar="N", min=1, max=4096, help="MPI ranks of one simulation (default: 1).")
]
Seed = Annotated[int | None, option("--seed", metavar="N", min=0, help="Seed of everything random (default: 0).")]
Effect = Annotated[
    list[Any] | None,
    option("--effect", metavar="NAME=VALUE", parser=named_number, help="Something the model leaves out; repeatable."),
]
Debug = Annotated[bool, option("--debug", help="Show the traceback of an error.")]
FMax = Annotated[float, option("--f-max", metavar="N", parser=bond_strength, help="Strength of a bond, in N.")]
DeltaMax = Annotated[float, option("--delta-max", metavar="M", parser=bond_opening, help="Critical opening, in m.")]
TrueFMax = Annotated[float | None, option("--f-max", metavar="N", parser=bond_strength, help="True f_max, in N.")]
TrueDeltaMax = Annotated[
    float | None, option("--delta-max", metavar="M", parser=bond_opening, help="True delta_max, in m.")
]
Grid = Annotated[
    Any,
    option(
        "--grid", metavar="FACTORS", parser=factors, help="Grid, in factors of the start (default: 0.8,0.9,1,1.1,1.2)."
    ),
]
Start = Annotated[
    Any,
    option("--start", metavar="F,D", parser=start_point, help="Start in the bundle: f_max in N, delta_max in m."),
]
Scale = Annotated[float | None, option("--mm-per-px", metavar="S", parser=pixel_pitch, help="Scale of the images.")]
ObjectiveChoice = Annotated[
    Objective | None, option("--objective", help="What is compared; fields where there are any, else load.")
]
Record = Annotated[
    Path | None, option("--from", metavar="FILE", help="Record of the testing machine, cleaned into load_cmod.csv.")
]
CmodRate = Annotated[
    float | None,
    option("--cmod-rate-mm-per-min", metavar="V", parser=positive, help="Gives a record without times its times."),
]
NoisePx = Annotated[
    float | None,
    option("--noise-px", metavar="S", parser=pixel_noise, help="Noise of displacement fields, in px (default: 0.01)."),
]
CameraScale = Annotated[
    float | None,
    option("--camera-mm-per-px", metavar="S", parser=pixel_pitch, help="Scale of speckle images (default: 0.0439)."),
]
NoiseGrey = Annotated[
    float | None,
    option("--noise-grey", metavar="S", parser=grey_noise, help="Noise of speckle images, of 255 (default: 2)."),
]
Frames = Annotated[
    int | None, option("--frames", metavar="N", min=20, max=2000, help="Fields or images under load (default: 61).")
]
Subset = Annotated[
    int | None, option("--subset", metavar="PX", parser=subset_size, help="Edge of a subset instead of the bundle's.")
]
Step = Annotated[
    int | None, option("--step", metavar="PX", min=1, max=1000, help="Distance of subsets instead of the bundle's.")
]
LoadNoise = Annotated[float, option("--load-noise-n", metavar="S", parser=load_noise, help="Noise of the load (N).")]
Temperature = Annotated[
    float | None,
    option("--temperature-c", metavar="T", parser=celsius, help="Temperature of the fracture test, in °C."),
]
TemperatureRange = Annotated[
    Any,
    option("--temperatures-c", metavar="A,B", parser=temperature_range, help="Entries between these, in °C, only."),
]
Times = Annotated[
    Any,
    option("--times", metavar="A,B", parser=time_span, help="Times, in s, that Burgers is fitted to (default: all)."),
]
Version = Annotated[bool, option("--version", is_eager=True, callback=show_version, help="Show the version and exit.")]
