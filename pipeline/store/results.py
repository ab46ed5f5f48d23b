"""The output folder of a command: result.json for people and programs, results.h5 for arrays."""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.store.atomic import SUFFIX, refused, write_atomically
from pipeline.store.schema import Layout

RESULT, ARRAYS = "result.json", "results.h5"


def prepare_output(folder: Path) -> Path:
    """Make the output folder and prove that files can be written there, before any long work.

    Raises
    ------
    StoreError
        naming the folder, the reason and what to do
    """
    folder = Path(folder)
    probe = folder / f".probe-{os.getpid()}{SUFFIX}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(b"can this folder be written to?")
    except OSError as error:
        raise refused(folder, error) from error
    finally:
        with contextlib.suppress(OSError):  # it was never made
            probe.unlink(missing_ok=True)
    return folder


def write_result(folder: Path, result: Mapping[str, Any]) -> Path:
    """Write result.json: keys sorted, NaN and infinities as null; raises StoreError where it cannot be written."""
    text = json.dumps(plain(result), indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False)
    write_atomically(folder / RESULT, (text + "\n").encode())
    return folder / RESULT


def read_result(folder: Path) -> dict[str, Any]:
    """What result.json says; refuses one that is missing or not JSON."""
    path = folder / RESULT
    try:
        return json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise MissingFileError(f"{path} does not exist: run the command that makes it first") from None
    except ValueError as error:
        raise StoreError(f"{path} is damaged ({error}): run the command that makes it again") from error


def write_arrays(folder: Path, layout: Layout, values: Mapping[str, Any]) -> Path:
    """Write results.h5 in the given layout; raises StoreError where it cannot be written or does not fit."""
    write_atomically(folder / ARRAYS, layout.encode(values))
    return folder / ARRAYS


def read_arrays(folder: Path, layout: Layout) -> dict[str, Any]:
    """The arrays of results.h5 by name; refuses one that is missing, damaged or of another layout."""
    return layout.decode(folder / ARRAYS)


def plain(value: Any) -> Any:
    """A value as JSON knows it: NumPy, paths and enums turned into numbers, lists and text; NaN into null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in (sorted(value) if isinstance(value, set | frozenset) else value)]
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Path):
        return str(value)
    raise InputError(f"a {type(value).__name__} cannot be written to {RESULT}: give numbers, text, lists or mappings")
