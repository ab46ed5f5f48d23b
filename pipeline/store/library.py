"""The library of identified mixtures: one HDF5 file, one row a test."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.errors import InputError, MissingFileError
from pipeline.store.atomic import refused, write_atomically
from pipeline.store.layouts import LIBRARY

Pair = tuple[float, float]
UNKNOWN: Pair = (float("nan"), float("nan"))
KEY_LENGTH = 8  # hexadecimal digits of an entry's name


@dataclass(frozen=True)
class LibraryEntry:
    """One identified test; units stand in the names, NaN is unknown.

    Parameters
    ----------
    mixture : str; what was tested, the same for all its specimens
    bundle : str; name of the test
    geometry : "seb" or "dct"
    temperature_c, thickness_mm, bond_area_mm2, cmod_rate_mm_per_min : float; bond_area is 2 r t of the bundle's lattice
    f_max_n, delta_max_m : float; per bond of that lattice
    f_max_95_n, delta_max_95_m : (low, high)
    variance_f_max, covariance, variance_delta_max : float; N², N m, m²
    energy_j_per_m2, energy_95_j_per_m2 : float and (low, high); f_max delta_max/(2 r t)
    peak_load_n, cmod_at_peak_mm, peak_load_mismatch : float; of the simulation at the optimum
    engine, objective, version : str
    accepted : bool; the fit passed its own checks
    source, added, note : str; where the result lay, when it was added (UTC), a remark
    key : str; name of the entry, made from what was identified
    """

    mixture: str
    bundle: str
    geometry: str
    temperature_c: float
    thickness_mm: float
    bond_area_mm2: float
    cmod_rate_mm_per_min: float
    f_max_n: float
    delta_max_m: float
    f_max_95_n: Pair
    delta_max_95_m: Pair
    variance_f_max: float
    covariance: float
    variance_delta_max: float
    energy_j_per_m2: float
    energy_95_j_per_m2: Pair
    peak_load_n: float
    cmod_at_peak_mm: float
    peak_load_mismatch: float
    engine: str
    objective: str
    version: str
    accepted: bool
    source: str
    added: str
    note: str = ""
    key: str = ""

    @property
    def traction_mpa(self) -> float:
        """f_max/(2 r t): comparable between radii and thicknesses."""
        return self.f_max_n / self.bond_area_mm2

    @property
    def strength_mpa(self) -> float:
        """Cohesive strength of the lattice as a continuum, √3 f_max/(2 r t)."""
        return 3**0.5 * self.traction_mpa

    @property
    def log_covariance(self) -> np.ndarray:
        """Of (ln f_max, ln delta_max); (2, 2)."""
        value = np.array([self.f_max_n, self.delta_max_m])
        own = [[self.variance_f_max, self.covariance], [self.covariance, self.variance_delta_max]]
        return np.array(own) / np.outer(value, value)


@dataclass(frozen=True)
class Filter:
    """Which entries are meant; None means all.

    Parameters
    ----------
    mixture, geometry, key : str; a key may be shortened
    temperatures_c : (low, high)
    """

    mixture: str | None = None
    geometry: str | None = None
    key: str | None = None
    temperatures_c: Pair | None = None

    def __call__(self, entry: LibraryEntry) -> bool:
        """Whether an entry is meant."""
        return (
            self.mixture in (None, entry.mixture)
            and self.geometry in (None, entry.geometry)
            and (self.key is None or entry.key.startswith(self.key))
            and (self.temperatures_c is None or self.temperatures_c[0] <= entry.temperature_c <= self.temperatures_c[1])
        )


class Library:
    """A file of entries, whole or as it was before: each change writes it anew and renames it.

    Two programs may add at the same time: a change holds a lock on the folder, which the system releases
    when the program ends, however it does.

    Parameters
    ----------
    path : Path; made by the first `add`
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)

    def entries(self, wanted: Filter | None = None) -> tuple[LibraryEntry, ...]:
        """The entries that are meant, in the order in which they were added.

        Raises
        ------
        MissingFileError, StoreError
            where there is no library, or it is damaged
        """
        if not self.path.exists():
            raise MissingFileError(f"{self.path} does not exist: `cohesive-bpm library add` makes it")
        found = _entries(LIBRARY.decode(self.path))
        return tuple(entry for entry in found if wanted is None or wanted(entry))

    def add(self, *entries: LibraryEntry) -> tuple[LibraryEntry, ...]:
        """Keep entries, all or none; they are returned with their keys.

        Raises
        ------
        InputError
            where the same result is already there, or given twice
        StoreError
            where the file is damaged or cannot be written: it stays as it was
        """
        with self._locked():
            kept = list(self.entries() if self.path.exists() else ())
            for entry in entries:
                named = replace(entry, key=_key(entry))
                same = next((other for other in kept if other.key == named.key), None)
                if same is not None:
                    raise InputError(
                        f"{self.path} holds this result of {entry.bundle} already, as {same.key} of mixture "
                        f"{same.mixture!r}, added {same.added}"
                    )
                kept.append(named)
            self._write(tuple(kept))
        return tuple(kept[len(kept) - len(entries) :])

    def remove(self, key: str) -> LibraryEntry:
        """Take one entry out; refuses a key that fits none or several."""
        with self._locked():
            kept = self.entries()
            meant = [entry for entry in kept if entry.key.startswith(key)]
            if len(meant) != 1 or not key:
                fits = ", ".join(entry.key for entry in meant) or "none"
                raise InputError(f"{key!r} must be the key of one entry of {self.path}, it fits {fits}")
            self._write(tuple(entry for entry in kept if entry is not meant[0]))
        return meant[0]

    def _write(self, entries: tuple[LibraryEntry, ...]) -> None:
        write_atomically(self.path, LIBRARY.encode(_columns(entries)))

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Alone in the folder until the change is done."""
        try:
            folder = os.open(self.path.parent, os.O_RDONLY)
        except OSError as error:
            raise refused(self.path, error) from error
        try:
            try:
                fcntl.flock(folder, fcntl.LOCK_EX)
            except OSError as error:  # a file system without locks
                raise refused(self.path, error) from error
            yield
        finally:
            os.close(folder)


def _key(entry: LibraryEntry) -> str:
    """A name made from test and estimate: the same result has the same name wherever it is added."""
    parts = (entry.bundle, entry.engine, entry.objective, f"{entry.bond_area_mm2:.9g}")
    text = "\n".join([*parts, f"{entry.f_max_n:.9g}", f"{entry.delta_max_m:.9g}"])
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]


def _columns(entries: tuple[LibraryEntry, ...]) -> dict[str, Any]:
    """Columns by the names of layout `LIBRARY`."""
    columns: dict[str, Any] = {}
    for field in fields(LibraryEntry):
        values = [getattr(entry, field.name) for entry in entries]
        shape = (len(entries), 2) if field.name.find("_95_") > 0 else (len(entries),)
        columns[field.name] = values if field.type == "str" else np.array(values).reshape(shape)
    return columns


def _entries(columns: dict[str, Any]) -> list[LibraryEntry]:
    """Rows of the columns."""
    rows = []
    for k in range(len(columns["key"])):
        values = {field.name: columns[field.name][k] for field in fields(LibraryEntry)}
        rows.append(LibraryEntry(**{name: _plain(value) for name, value in values.items()}))
    return rows


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return tuple(value.tolist())
    return value.item() if isinstance(value, np.generic) else value
