"""Settings of a run: how the bundle's question is answered, not what was measured.

A TOML file of these keys (unknown ones refused, units in their names) may be given to a command; options on
the command line win over it.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from pipeline.core.errors import InputError, MissingFileError
from pipeline.core.units import MM


def _increasing(factors: tuple[float, ...]) -> tuple[float, ...]:
    if any(b <= a for a, b in pairwise(factors)):
        raise ValueError("must increase from entry to entry")
    return factors


def _distinct(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(names)) < len(names):
        raise ValueError("must name each parameter once")
    return names


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise ValueError("must be odd: a subset has a centre")
    return value


SlurmName = Annotated[
    str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+,-]{0,63}$")
]  # nothing that a shell could take amiss
Factor = Annotated[float, Field(gt=0, le=10)]
Factors = Annotated[tuple[Factor, ...], Field(strict=False, min_length=3, max_length=15), AfterValidator(_increasing)]


class RunSettings(BaseModel):
    """Frozen, validated settings of one run; every key has a default.

    Raises (through `run_settings` and `load_settings`) InputError with every problem at once.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    engine: Literal["lammps", "equilibrium", "reference"] = Field(default="lammps", description="what solves the tests")
    accuracy: Annotated[float, Field(ge=1e-5, le=0.2)] = Field(
        default=0.01, description="quasi-static error asked for, relative, in load and displacement"
    )
    workers: Annotated[int, Field(ge=1, le=4096)] | None = Field(
        default=None, description="simulations at a time; absent: as many as there are processors"
    )
    dask: Annotated[str, Field(pattern=r"^(tcp|tls|ws|wss)://[A-Za-z0-9_.:\[\]-]+$")] | None = Field(
        default=None, description="address of a dask scheduler whose workers simulate; absent: this machine does"
    )
    ranks: Annotated[int, Field(ge=1, le=4096)] = Field(
        default=1, description="MPI ranks of one simulation by LAMMPS; times workers no more than there are processors"
    )
    seed: Annotated[int, Field(ge=0, lt=2**63)] = Field(default=0, description="of everything random")
    radius_mm: Annotated[float, Field(ge=1e-3, le=20)] | None = Field(
        default=None, description="particle radius instead of the bundle's; f_max/(2 r t) is kept"
    )
    objective: Literal["fields", "load", "both"] | None = Field(
        default=None, description="absent: fields where the bundle has some, else load"
    )
    rigid: Literal["fit", "keep"] = Field(
        default="fit", description="fit: rigid motion is taken out of the difference of the fields; keep: the paper"
    )
    grid: Factors = Field(default=(0.8, 0.9, 1.0, 1.1, 1.2), description="of f_max and delta_max, times their start")
    grid_f_max: Factors | None = Field(default=None, description="of f_max alone, instead of grid")
    grid_delta_max: Factors | None = Field(default=None, description="of delta_max alone, instead of grid")
    recentring_count: Annotated[int, Field(ge=0, le=10)] = Field(
        default=3, description="how often the grid may be moved when the optimum lies on its edge"
    )
    recentring_steps: Annotated[int, Field(ge=1, le=10)] = Field(default=2, description="grid lines by which it moves")
    surrogate: Literal["objective", "data"] = Field(
        default="data",
        description="what is interpolated over the grid: every simulated number, or the objective, as in the paper",
    )
    placement_count: Annotated[int, Field(ge=0, le=100)] = Field(
        default=6,
        description="other placements of the lattice that are simulated at the optimum and averaged; their scatter "
        "is in the interval",
    )
    scaling: bool = Field(
        default=False,
        description="one simulation for all nodes of equal delta_max/f_max, by the scaling law of small kinematics; "
        "damage in the aggregate is looked for, nodes that have some are simulated by themselves",
    )
    ratio_count: Annotated[int, Field(ge=4, le=50)] | None = Field(
        default=None,
        description="simulations for the whole grid, one a ratio delta_max/f_max; nodes are interpolated between them, "
        "and the report says how far that errs; absent: every node is simulated",
    )
    modulus_std: Annotated[float, Field(ge=0, le=0.5)] = Field(
        default=0.05,
        description="standard deviation of the mastic modulus, relative; carried into the interval of f_max",
    )
    more_parameters: Annotated[
        tuple[
            Literal[
                "aggregate_strength_ratio",
                "interface_strength_ratio",
                "interface_opening_ratio",
                "shear_strength_ratio",
                "mastic_modulus",
            ],
            ...,
        ],
        Field(strict=False, max_length=2),
        AfterValidator(_distinct),
    ] = Field(
        default=(),
        description="one or two further parameters, estimated together with f_max and delta_max on a sparse grid of 25 "
        "or 41 simulations about the optimum",
    )
    more_parameters_range: Annotated[float, Field(gt=0, le=0.9)] = Field(
        default=0.1, description="half the width of that grid, relative, in every parameter"
    )
    viscoelastic: bool = Field(default=False, description="Burgers bonds from creep.csv")
    subset_size_px: Annotated[int, Field(ge=5, le=201), AfterValidator(_odd)] | None = Field(
        default=None, description="edge of a subset of the image correlation instead of the bundle's"
    )
    grid_step_px: Annotated[int, Field(ge=1, le=1000)] | None = Field(
        default=None, description="distance of subset centres instead of the bundle's"
    )
    search_px: Annotated[int, Field(ge=0, le=2000)] = Field(
        default=100, description="motion from one image to the next within which a lost point is looked for"
    )
    restart_steps: Annotated[int, Field(ge=20, le=10**9)] | None = Field(
        default=None, description="steps between restart files of an exported study; absent: about half a minute"
    )
    slurm_partition: SlurmName | None = Field(default=None, description="of an exported study's jobs")
    slurm_account: SlurmName | None = Field(default=None, description="that their time is charged to")
    slurm_walltime_min: Annotated[int, Field(ge=1, le=525600)] = Field(
        default=60, description="of one point, in minutes; what is not finished then is queued again"
    )
    slurm_array_limit: Annotated[int, Field(ge=1, le=100000)] | None = Field(
        default=None, description="points that may run at a time; absent: all"
    )
    levelling: bool = Field(default=False, description="simulated fields go through the same image correlation")

    @property
    def radius(self) -> float | None:
        """m, None: the bundle's own"""
        return None if self.radius_mm is None else self.radius_mm * MM

    @property
    def f_factors(self) -> tuple[float, ...]:
        """Grid lines of f_max over its start."""
        return self.grid_f_max or self.grid

    @property
    def delta_factors(self) -> tuple[float, ...]:
        """Grid lines of delta_max over its start."""
        return self.grid_delta_max or self.grid


def run_settings(options: Mapping[str, Any], file: str = "options") -> RunSettings:
    """Settings from a mapping; None stands for the default. Refuses with every problem at once."""
    try:
        return RunSettings.model_validate({key: value for key, value in options.items() if value is not None})
    except ValidationError as error:
        problems = error.errors()
        entries = {problem["loc"][0] for problem in problems if len(problem["loc"]) > 1}
        told = (p for p in problems if p["type"] != "too_short" or p["loc"][0] not in entries)  # a faulty one counts
        raise InputError("\n".join(f"{file}: {_sentence(problem)}" for problem in told)) from None


def load_settings(path: Path, options: Mapping[str, Any] | None = None) -> RunSettings:
    """Settings from a TOML file; `options` that are not None win over it.

    Raises
    ------
    MissingFileError, InputError
        where the file is missing, not TOML, or has a key or value that is refused
    """
    try:
        raw = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except FileNotFoundError:
        raise MissingFileError(f"{path} does not exist: give the TOML file with the settings of the run") from None
    except (OSError, ValueError, RecursionError) as error:  # not there, not UTF-8, not TOML, nested too deep
        raise InputError(f"{path.name} cannot be read as TOML: {error}") from None
    given = {key: value for key, value in (options or {}).items() if value is not None}
    return run_settings(raw | given, path.name)


SLURM_RULE = "must be a name of SLURM: letters, digits and . _ + , -, the first a letter or digit, at most 64"
_PATTERNS = {"dask": "must be an address as `dask scheduler` prints it, as in tcp://host:8786"}
_LENGTHS = {"too_short": "needs at least {min_length} entries", "too_long": "has more than {max_length} entries"}


def _sentence(problem: ErrorDetails) -> str:
    """One problem in words: key, value, rule."""
    key, kind = str(problem["loc"][0]), problem["type"]
    if kind == "extra_forbidden":
        meant = difflib.get_close_matches(key, list(RunSettings.model_fields), n=1)
        return f"{key} is not a setting: " + (f"did you mean {meant[0]}?" if meant else "remove it")
    if kind == "string_pattern_mismatch":
        return f"{key} = {problem['input']!r}: {_PATTERNS.get(key, SLURM_RULE)}"
    if kind in _LENGTHS:
        return f"{key} = {problem['input']!r}: {_LENGTHS[kind].format(**problem['ctx'])}"
    rule = str(problem["ctx"]["error"]) if kind == "value_error" else problem["msg"].replace("Input should", "should")
    return f"{key} = {problem['input']!r}: {rule}"


def settings_table() -> str:
    """Every setting with its default and meaning, as a Markdown table for the documentation."""
    rows = [
        f"| `{key}` | {'' if field.default is None else repr(field.default)} | {field.description} |"
        for key, field in RunSettings.model_fields.items()
    ]
    return "\n".join(["| key | default | meaning |", "|---|---|---|", *rows]) + "\n"
