"""Bundles made by us: one to fill in, and one with everything in it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError, StoreError
from pipeline.core.field import DisplacementField
from pipeline.core.units import MINUTE, MM
from pipeline.store import creep, frames, load_cmod
from pipeline.store.atomic import refused, write_atomically
from pipeline.store.experiment import FILE, Experiment
from pipeline.store.fields import encode_fields
from pipeline.store.images import save_png
from pipeline.store.plausibility import curve_problems
from pipeline.store.records import Record
from pipeline.store.sources import FIELDS, LABELS
from pipeline.store.toml_text import toml_text

FIRST = {
    "seb": {"thickness_mm": 40.0, "depth_mm": 60.0, "span_mm": 130.0, "length_mm": 137.0, "notch_length_mm": 15.0},
    "dct": {"thickness_mm": 50.0},
}
RATE = {"seb": 0.5, "dct": 1.0}  # mm/min: Hill et al. 2017
START_F_MAX, START_DELTA_MAX = 71.0, 1.14e-4  # N at r = 0.3 mm and t = 40 mm, m: Hill et al. 2017


@dataclass(frozen=True)
class Contents:
    """What a bundle holds beside its experiment.toml; None or empty is left out.

    Parameters
    ----------
    curve : LoadCurve
    fields : DisplacementField counted by time
    labels : (rows, columns) uint8 array
    photograph : uint8 or uint16 array, (rows, columns) or (rows, columns, 3)
    images : speckle images, one after the other (may be a generator), with
    frame_time : (k,) array, s
    creep : CreepRecord
    """

    curve: LoadCurve | None = None
    fields: DisplacementField | None = None
    labels: np.ndarray | None = None
    photograph: np.ndarray | None = None
    images: Iterable[np.ndarray] = ()
    frame_time: np.ndarray | None = None
    creep: creep.CreepRecord | None = None


def first_experiment(geometry: str, name: str, cmod_rate: float | None = None) -> Experiment:
    """Settings to begin with: the paper's, for "seb" or "dct"; `cmod_rate` in m/s where it is known."""
    if geometry not in FIRST:
        raise InputError(f"geometry {geometry!r} is not known: choose {' or '.join(FIRST)}")
    rate = RATE[geometry] if cmod_rate is None else float(f"{cmod_rate / MM * MINUTE:.4g}")
    thickness = FIRST[geometry]["thickness_mm"]
    return Experiment.model_validate(
        {
            "format": 1,
            "name": re.sub(r"[^A-Za-z0-9._-]", "-", name).lstrip(".-")[:100] or "test",
            "specimen": {"geometry": geometry, **FIRST[geometry]},
            "loading": {"cmod_rate_mm_per_min": rate},
            "material": {"mastic_modulus_gpa": 10.0, "aggregate_modulus_gpa": 50.0},
            "start": {"f_max_n": START_F_MAX * thickness / 40.0, "delta_max_m": START_DELTA_MAX},
        }
    )


def new_bundle(
    folder: Path, geometry: str, record: Record | None = None, cmod_rate: float | None = None
) -> tuple[str, ...]:
    """Make a bundle to fill in: a commented experiment.toml and, from a machine's record, a clean load_cmod.csv.

    Parameters
    ----------
    folder : Path; refused where it holds anything
    geometry : "seb" or "dct"
    record : Record of `read_record`
    cmod_rate : float, m/s; of the test; without it the record's own mean rate, or the usual one

    Returns
    -------
    sentences on what was written, and on what to look at (a record that does not suit the first sizes)
    """
    folder = Path(folder)
    _refuse_filled(folder)
    curve = None if record is None else record.curve
    experiment = first_experiment(geometry, folder.resolve().name, cmod_rate or (curve and mean_rate(curve)) or None)
    if record is not None and record.load_std is not None:
        noise = experiment.noise.model_copy(update={"load_std_n": float(f"{record.load_std:.4g}")})
        experiment = experiment.model_copy(update={"noise": noise})
    write_bundle(folder, experiment, Contents(curve=curve))
    told = record.report.sentences if record else ()
    look = curve_problems(curve, experiment.specimen.specimen(), experiment.loading.cmod_rate) if curve else []
    return (*told, *(f"To look at, with the sizes as they stand in {FILE}: {sentence}" for sentence in look))


def mean_rate(curve: LoadCurve) -> float:
    """Mean CMOD rate of a record, m/s; refuses one whose CMOD does not grow."""
    rate = float((curve.cmod[-1] - curve.cmod[0]) / (curve.time[-1] - curve.time[0]))
    if not rate > 0:
        raise InputError("CMOD does not grow from the first to the last row: is another column the CMOD?")
    return rate


def write_bundle(folder: Path, experiment: Experiment, contents: Contents) -> None:
    """Write a bundle, each file whole or not at all, experiment.toml last.

    Raises
    ------
    InputError
        where the contents contradict each other, or the folder holds another source of the same thing
    StoreError
        naming the file that cannot be written and what to do
    """
    folder = Path(folder)
    _refuse_contradiction(folder, contents)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if contents.frame_time is not None:
            (folder / frames.FOLDER).mkdir(exist_ok=True)
    except OSError as error:
        raise refused(folder, error) from error
    if contents.curve is not None:
        write_atomically(folder / load_cmod.FILE, load_cmod.encode_load_cmod(contents.curve))
    if contents.fields is not None:
        write_atomically(folder / FIELDS, encode_fields(contents.fields))
    if contents.labels is not None:
        save_png(folder / LABELS, np.asarray(contents.labels, np.uint8))
    if contents.photograph is not None:
        save_png(folder / "specimen.png", contents.photograph)
    if contents.creep is not None:
        write_atomically(folder / creep.FILE, creep.encode_creep(contents.creep))
    if contents.frame_time is not None:
        _write_images(folder, contents.images, contents.frame_time)
    write_atomically(folder / FILE, toml_text(experiment).encode())


def _write_images(folder: Path, images: Iterable[np.ndarray], time: np.ndarray) -> None:
    """Speckle images one by one, numbered, then their times."""
    names = [f"frame_{index:04d}.png" for index in range(time.size)]
    for name, image in zip(names, images, strict=True):
        save_png(folder / frames.FOLDER / name, image)
    write_atomically(folder / frames.FILE, frames.frames_csv(tuple(names), time))


def _refuse_filled(folder: Path) -> None:
    """Refuse a folder in which anything lies."""
    try:
        filled = folder.exists() and any(folder.iterdir())
    except OSError as error:
        raise refused(folder, error) from error
    if filled:
        raise StoreError(f"{folder} is not empty: a new bundle gets a folder of its own, choose another name")


def _refuse_contradiction(folder: Path, contents: Contents) -> None:
    """Refuse two sources of the same thing, in the contents or left in the folder."""
    rivals = (
        (contents.fields is not None, [folder / frames.FOLDER], contents.frame_time is not None),
        (contents.frame_time is not None, [folder / FIELDS], contents.fields is not None),
        (contents.labels is not None, list(folder.glob("specimen.*")), contents.photograph is not None),
        (contents.photograph is not None, [folder / LABELS], contents.labels is not None),
    )
    for given, files, both in rivals:
        there = [path.name for path in files if path.exists()]
        if given and (both or there):
            what = there[0] if there else "a second source of the same thing"
            raise InputError(f"{folder}: a bundle cannot hold this together with {what}: choose an empty folder")
