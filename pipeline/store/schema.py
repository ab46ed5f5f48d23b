"""HDF5 layouts as tables: writing, reading, checking and the documentation all follow the same rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from pipeline.core.errors import MissingFileError, StoreError
from pipeline.store.atomic import written_aside

Shape = tuple[str | int, ...]


LONGEST = 60_000  # bytes of text in an attribute: HDF5 keeps attributes in headers of 64 kB


@dataclass(frozen=True)
class Entry:
    """One row of a layout.

    Parameters
    ----------
    name : str; path of the dataset, or name of the attribute of the root
    shape : names of dimensions or fixed sizes; () is a scalar, None an attribute
    unit, meaning : str; for the documentation
    dtype : str; NumPy's name, or "str" for text
    also : other shapes that are accepted
    optional : bool
    """

    name: str
    shape: Shape | None
    unit: str
    meaning: str
    dtype: str = "float64"
    also: tuple[Shape, ...] = ()
    optional: bool = False

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Every accepted shape of a dataset."""
        return () if self.shape is None else (self.shape, *self.also)


@dataclass(frozen=True)
class Layout:
    """A kind of HDF5 file; `format` is its version, written as an attribute."""

    title: str
    entries: tuple[Entry, ...]
    format: int = 1

    def encode(self, values: Mapping[str, Any]) -> bytes:
        """The whole file as bytes, from values by entry name (None: left out).

        Arrays are compressed, and zlib's check sums stand with them as HDF5's own (libver v110) with the
        file's structures, so that a damaged file is known by reading it. Refuses names that the layout
        does not have and shapes that do not fit it.
        """
        given = {name: value for name, value in values.items() if value is not None}
        unknown = set(given) - {entry.name for entry in self.entries}
        if unknown:
            raise StoreError(f"{self.title}: {sorted(unknown)} is not in the layout")
        name = f"{self.title}-{id(given)}"  # of a file in memory: nothing is written under it
        with h5py.File(name, "w", driver="core", backing_store=False, libver=("v110", "v110")) as file:
            file.attrs["format"] = self.format
            for entry in self.entries:
                if entry.name in given:
                    _put(file, entry, given[entry.name])
            _refuse(self.title, self.problems(file))
            file.flush()
            return bytes(file.id.get_file_image())

    def write(self, path: Path, values: Mapping[str, Any], fill: Callable[[h5py.File], None]) -> None:
        """Write a file too large to be held in memory: whole under another name first, then renamed.

        Parameters
        ----------
        path : Path
        values : some entries by name
        fill : writes the other datasets into the open file

        Raises
        ------
        StoreError
            where it cannot be written or does not fit the layout
        """
        with written_aside(path) as part, h5py.File(part, "w", libver=("v110", "v110")) as file:
            file.attrs["format"] = self.format
            for entry in self.entries:
                if entry.name in values:
                    _put(file, entry, values[entry.name])
            fill(file)
            _refuse(path.name, self.problems(file))

    def decode(self, path: Path) -> dict[str, Any]:
        """Values by entry name, None where an optional one is absent.

        Raises
        ------
        MissingFileError
            where there is no such file
        StoreError
            naming everything that does not follow the layout, or that the file is damaged
        """
        with opened(path) as file:
            try:
                problems = self.problems(file)
                values = {} if problems else {entry.name: _get(file, entry) for entry in self.entries}
            except (OSError, RuntimeError, ValueError, KeyError) as error:
                raise _damaged(path, error) from error
        _refuse(path.name, problems)
        return values

    def problems(self, file: h5py.File) -> list[str]:
        """One sentence for each thing in which an open file does not follow the layout."""
        found = [] if file.attrs.get("format") == self.format else [f"attribute format must be {self.format}"]
        sizes: dict[str, tuple[int, str]] = {}
        for entry in self.entries:
            held = entry.name in file.attrs if entry.shape is None else entry.name in file
            if not held:
                found += [] if entry.optional else [f"{entry.name} is missing ({entry.meaning})"]
            elif entry.shape is not None:
                found += _misfit(entry, file[entry.name], sizes)
        return found

    def table(self) -> str:
        """The layout as a Markdown table, for the documentation."""
        rows = [f"| `{e.name}` | {_kind(e)} | {e.unit} | {e.meaning} |" for e in self.entries]
        return "\n".join(["| name | type and shape | unit | meaning |", "|---|---|---|---|", *rows]) + "\n"


def _refuse(name: str, problems: list[str]) -> None:
    if problems:
        raise StoreError("\n".join(f"{name}: {problem}" for problem in problems))


def opened(path: Path) -> h5py.File:
    """An HDF5 file open for reading; refuses one that is missing, truncated or not HDF5."""
    if not path.is_file():
        reason = "is not a file" if path.exists() else "does not exist"
        raise MissingFileError(f"{path} {reason}: check its name, or make it again")
    try:
        return h5py.File(path, "r", locking=False)
    except PermissionError as error:
        raise StoreError(f"{path.name}: there is no permission to read it: change its rights") from error
    except (OSError, RuntimeError) as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> StoreError:
    reason = "it is truncated" if "truncated" in str(error) else "it is no readable HDF5 file"
    return StoreError(f"{path.name}: {reason} ({path.stat().st_size} bytes): make or copy it again")


def text_of(file: h5py.File, name: str) -> str | None:
    """The text of an attribute, of fixed or of variable length; None where there is none, StoreError where damaged."""
    value = file.attrs.get(name)
    if not isinstance(value, str | bytes | None):
        raise StoreError(f"{file.filename}: attribute {name} is no text: make or copy the file again")
    try:
        return value.decode() if isinstance(value, bytes) else value
    except UnicodeDecodeError as error:
        raise StoreError(f"{file.filename}: attribute {name} is damaged: make or copy the file again") from error


def _put(file: h5py.File, entry: Entry, value: Any) -> None:
    if entry.shape is None:
        if entry.dtype == "str" and len(str(value).encode()) > LONGEST:
            raise StoreError(f"{entry.name} has more than {LONGEST} bytes of text: an attribute of HDF5 holds no more")
        file.attrs[entry.name] = _encoded(value) if entry.dtype == "str" else np.dtype(entry.dtype).type(value)
        return
    array = _encoded(value) if entry.dtype == "str" else np.asarray(value, entry.dtype)
    packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True} if array.size else {}
    dataset = file.create_dataset(entry.name, data=array, **(packed if array.ndim else {}))
    dataset.attrs["unit"] = entry.unit


def _get(file: h5py.File, entry: Entry) -> Any:
    if entry.shape is None:
        if entry.dtype == "str":
            return text_of(file, entry.name)
        value = file.attrs.get(entry.name)
        return value if value is None else np.dtype(entry.dtype).type(value).item()
    if entry.name not in file:
        return None
    if entry.dtype == "str":
        return np.asarray(file[entry.name].asstr()[()], object)
    return np.asarray(file[entry.name][()], entry.dtype)


def _encoded(value: Any) -> np.ndarray:
    """Texts as UTF-8 of one length, which is packed and checked as numbers are.

    Texts of variable length lie in a heap of the file, and HDF5 reads a damaged one for ever.
    """
    texts = [str(text).encode() for text in np.ravel(np.asarray(value, object))]
    length = max(map(len, texts), default=1) or 1
    return np.array(texts, h5py.string_dtype("utf-8", length)).reshape(np.shape(value))


def _misfit(entry: Entry, item: Any, sizes: dict[str, tuple[int, str]]) -> list[str]:
    """What is wrong with kind and shape of one dataset; `sizes` remembers each dimension and who set it."""
    if not isinstance(item, h5py.Dataset):
        return [f"{entry.name} must be a dataset"]
    if item.dtype.kind not in {"bool": "biu", "str": "SO"}.get(entry.dtype, "biuf"):
        return [f"{entry.name} holds {item.dtype}, it must hold {entry.dtype}"]
    reasons = [_mismatch(shape, item.shape, sizes) for shape in entry.shapes]
    if "" not in reasons:
        return [f"{entry.name} has shape {item.shape}, it must be {_spelled(entry)}{reasons[0]}"]
    for name, size in zip(entry.shapes[reasons.index("")], item.shape, strict=True):
        if isinstance(name, str):
            sizes.setdefault(name, (size, entry.name))
    return []


def _mismatch(wanted: Shape, shape: tuple[int, ...], sizes: dict[str, tuple[int, str]]) -> str:
    """Empty where the shape fits, else the reason (may be a blank remark)."""
    if len(wanted) != len(shape):
        return " "
    for name, size in zip(wanted, shape, strict=True):
        known, by = (name, "") if isinstance(name, int) else sizes.get(name, (size, ""))
        if known != size:
            return f" with {name} = {known} as in {by}" if by else " "
    return ""


def _spelled(entry: Entry) -> str:
    return " or ".join(
        "(" + ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "") + ")" for shape in entry.shapes
    )


def _kind(entry: Entry) -> str:
    place = f"attribute, {entry.dtype}" if entry.shape is None else f"{entry.dtype} {_spelled(entry)}"
    return place + (", optional" if entry.optional else "")
