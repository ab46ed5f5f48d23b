"""manifest.json of an exported study: what every point is, and what every file must be."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from pipeline.core.errors import MissingFileError, StoreError

FILE, FORMAT = "manifest.json", 1
REMEDY = "copy it from where it was exported, or export into another folder"


@dataclass(frozen=True)
class Point:
    """One simulation of a study.

    Parameters
    ----------
    number : int; its folder is points/NUMBER in four digits
    f_max_n : float, N; per bond of the bundle's lattice
    delta_max_m : float, m
    key : str; SHA-256 of the problem and its engine, as of kept simulations
    inputs : str; SHA-256 of inputs.sha256 in the point's folder, which lists all of its inputs
    """

    number: int
    f_max_n: float
    delta_max_m: float
    key: str
    inputs: str = ""

    @property
    def folder(self) -> str:
        """Its folder in the study."""
        return f"points/{self.number:04d}"


@dataclass(frozen=True)
class Manifest:
    """What was exported.

    Parameters
    ----------
    study : str; SHA-256 of the keys of the first points: studies are told apart by it
    version : str; of the program that exported
    bundle : str; name of the test
    variant : str; the kind of deck: "cohesive", or a stock approximation, "table" or "plastic"
    engine : str; label under which the simulations are kept
    settings : settings of the run
    lammps : name of a version of LAMMPS → whether the decks were tested with it
    points : tuple of Point
    files : path in the study → SHA-256, of everything that does not belong to a point
    """

    study: str
    version: str
    bundle: str
    variant: str
    engine: str
    settings: dict[str, Any]
    lammps: dict[str, str]
    points: tuple[Point, ...]
    files: dict[str, str] = field(default_factory=dict)

    def with_points(self, points: tuple[Point, ...]) -> Manifest:
        """The same study with other points."""
        return replace(self, points=points)


def study_of(keys: list[str]) -> str:
    """The name of the study of these simulations."""
    return hashlib.sha256("\n".join(keys).encode()).hexdigest()


def manifest_text(manifest: Manifest) -> str:
    """The content of manifest.json; its last key is a checksum of all others."""
    values = {"format": FORMAT, "program": "cohesive-bpm", **asdict(manifest)}
    return json.dumps(values | {"checksum": _checksum(values)}, indent=1, ensure_ascii=False) + "\n"


def read_manifest(study: Path) -> Manifest:
    """The manifest of an exported study.

    Raises
    ------
    MissingFileError
        where the folder is none
    StoreError
        where it is damaged, or of another program or format
    """
    path = Path(study) / FILE
    try:
        values = json.loads(path.read_text("utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise MissingFileError(
            f"{study} is no exported study: {FILE} is missing; `export BUNDLE OUT` makes one"
        ) from None
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{path} is damaged ({error}): {REMEDY}") from None
    return _manifest(values, path)


def _manifest(values: Any, path: Path) -> Manifest:
    if not isinstance(values, dict) or values.get("program") != "cohesive-bpm":
        raise StoreError(f"{path} is the manifest of another program: give the folder that `export` has made")
    if values.get("format") != FORMAT:
        raise StoreError(f"{path} has format {values.get('format')}, this version reads {FORMAT}: {REMEDY}")
    told = values.pop("checksum", None)
    if told != _checksum(values):
        raise StoreError(f"{path} was changed after it was written: {REMEDY}")
    known = {entry.name for entry in fields(Manifest)}
    points = tuple(Point(**point) for point in values["points"])
    return Manifest(**{name: values[name] for name in known - {"points"}}, points=points)


def _checksum(values: dict[str, Any]) -> str:
    plain = json.dumps(values, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(plain.encode()).hexdigest()
