"""fields.h5: displacement fields measured elsewhere, or by us."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import h5py
import numpy as np

from pipeline.core.errors import StoreError
from pipeline.core.field import DisplacementField
from pipeline.core.units import MM
from pipeline.store.atomic import write_atomically
from pipeline.store.layouts import FIELDS
from pipeline.store.schema import opened


def read_fields(path: Path, default_std: float | None = None) -> DisplacementField:
    """A displacement field in SI, counted by time in s.

    Points without a finite displacement and standard deviation are invalid in that frame, whatever the
    file says; their numbers are left as they are.

    Parameters
    ----------
    path : Path of a file of layout `FIELDS`
    default_std : float, m; stands in where the file gives none

    Raises
    ------
    MissingFileError, StoreError
        naming the file and everything in it that breaks a rule
    """
    problems = field_problems(path, default_std is None)
    if problems:
        raise StoreError("\n".join(problems))
    values = FIELDS.decode(path)
    displacement = values["displacement"] * MM
    std = default_std if values["std_mm"] is None else values["std_mm"] * MM
    spread = np.broadcast_to(np.asarray(std, float), displacement.shape[:2]).copy()
    known = np.isfinite(displacement).all(axis=2) & np.isfinite(spread)
    return DisplacementField(values["points"] * MM, displacement, values["valid"] & known, spread, values["time_s"])


def write_fields(path: Path, field: DisplacementField) -> None:
    """Write a displacement field whose abscissa is time; raises StoreError where that is not possible."""
    write_atomically(path, encode_fields(field))


def stream_fields(
    path: Path, points: np.ndarray, time: np.ndarray, frames: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]
) -> None:
    """Write a displacement field frame by frame, one of which is in memory at a time.

    Parameters
    ----------
    path : Path
    points : (n, 2) array, m
    time : (frames,) array, s
    frames : displacement (n, 2) in m, valid (n,) and standard deviation (n,) in m of one frame after the other

    Raises
    ------
    StoreError
        naming the file and what to do; an earlier one stands untouched
    """

    def fill(file: h5py.File) -> None:
        shape = (time.size, len(points))
        wide = _growing(file, "displacement", (*shape, 2), "float64", "mm")
        valid, std = _growing(file, "valid", shape, "bool", "1"), _growing(file, "std_mm", shape, "float64", "mm")
        count = 0
        for number, (moved, usable, spread) in enumerate(frames):
            if number == time.size:
                raise StoreError(f"{path.name}: more frames came than the {number} times")
            wide[number], valid[number], std[number] = moved / MM, usable, spread / MM
            count += 1
        if count != time.size:
            raise StoreError(f"{path.name}: {count} frames came for {time.size} times")

    FIELDS.write(path, {"points": points / MM, "time_s": time}, fill)


def _growing(file: h5py.File, name: str, shape: tuple[int, ...], dtype: str, unit: str) -> h5py.Dataset:
    """A compressed dataset, read and written a frame at a time."""
    made = file.create_dataset(
        name, shape, dtype, chunks=(1, *shape[1:]), compression="gzip", compression_opts=1, shuffle=True
    )
    made.attrs["unit"] = unit
    return made


def encode_fields(field: DisplacementField) -> bytes:
    """The content of fields.h5; the standard deviation is written as short as it can be."""
    std = field.std / MM
    same = std.size > 0 and bool(np.all(std == std.flat[0]))
    return FIELDS.encode(
        {
            "points": field.points / MM,
            "displacement": field.displacement / MM,
            "time_s": field.abscissa,
            "valid": field.valid,
            "std_mm": std.flat[0] if same else std,
        }
    )


def field_problems(path: Path, std_needed: bool = True) -> list[str]:
    """One sentence for each thing that is wrong with a file, without reading its displacements."""
    try:
        with opened(path) as file:
            found = FIELDS.problems(file)
            if std_needed and "std_mm" not in file:
                found.append("std_mm is missing: write it, or give [noise] displacement_std_mm")
            return [f"{path.name}: {problem}" for problem in found or _value_problems(file)]
    except OSError as error:  # also MissingFileError and StoreError
        return [str(error)]


def _value_problems(file: h5py.File) -> list[str]:
    """What is wrong with points, times and standard deviations."""
    time, points = file["time_s"][()], file["points"][()]
    std = file["std_mm"][()] if "std_mm" in file else np.zeros(())
    back = np.flatnonzero(np.diff(time) <= 0)
    empty = not (time.size and points.size)
    rules = (
        (empty, "holds no frame or no point: nothing can be compared"),
        (not np.isfinite(points).all(), "points holds NaN: every point needs a position; mark bad ones in valid"),
        (not np.isfinite(time).all(), "time_s holds NaN: every frame needs a time"),
        (
            back.size > 0,
            f"time_s does not increase at frame {int(back[0]) + 1 if back.size else 0}: sort the frames by time",
        ),
        (bool(np.any(std < 0)), "std_mm is negative: a standard deviation is zero or larger"),
    )
    return [sentence for bad, sentence in rules if bad]
