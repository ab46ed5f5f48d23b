"""The experiment bundle: one physical test, read, checked and turned into SI."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import BundleError, InputError, MissingFileError
from pipeline.core.field import DisplacementField
from pipeline.core.observation import stations
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.store import frames
from pipeline.store.creep import CreepRecord, parse_creep
from pipeline.store.experiment import FILE, Experiment, parse_experiment, read_toml
from pipeline.store.fields import read_fields
from pipeline.store.inspection import (
    cut,
    field_file_problems,
    material_problems,
    photograph_problems,
    record_problems,
    speckle_problems,
)
from pipeline.store.load_cmod import read_load_cmod
from pipeline.store.noise import estimate_load_noise
from pipeline.store.sections import (
    DicSection,
    LoadingSection,
    MaterialSection,
    ModelSection,
    NoiseSection,
    ObservationSection,
    PixelFrame,
    StartSection,
)
from pipeline.store.sources import Sources, find_sources

BEYOND = 1.1  # the simulated test ends this share beyond the last station


@dataclass(frozen=True)
class Bundle:
    """One physical test.

    Parameters
    ----------
    folder : Path
    experiment : Experiment; the settings, in the units of their keys, with properties in SI
    specimen : Specimen, m
    sources : Sources; the files
    curve : LoadCurve with load_std, or None where the bundle has no record
    frame_time : (k,) array, s, of the speckle images, or None
    creep : CreepRecord or None
    """

    folder: Path
    experiment: Experiment
    specimen: Specimen
    sources: Sources
    curve: LoadCurve | None
    frame_time: np.ndarray | None
    creep: CreepRecord | None

    @property
    def name(self) -> str:
        return self.experiment.name

    @property
    def loading(self) -> LoadingSection:
        return self.experiment.loading

    @property
    def camera(self) -> PixelFrame | None:
        return self.experiment.camera

    @property
    def dic(self) -> DicSection:
        return self.experiment.dic

    @property
    def noise(self) -> NoiseSection:
        return self.experiment.noise

    @property
    def material(self) -> MaterialSection:
        return self.experiment.material

    @property
    def model(self) -> ModelSection:
        return self.experiment.model

    @property
    def start(self) -> StartSection | None:
        return self.experiment.start

    @property
    def observation(self) -> ObservationSection:
        return self.experiment.observation

    @property
    def specimen_image(self) -> Path | None:
        """The photograph of the cut face."""
        return self.sources.photograph

    @property
    def labels(self) -> Path | None:
        """The label image."""
        return self.sources.labels

    @property
    def image_frame(self) -> PixelFrame | None:
        """How photograph or label image lie on the specimen."""
        return self.experiment.specimen.image

    @property
    def images(self) -> tuple[Path, ...]:
        """The speckle images, sorted by name."""
        return self.sources.images

    @cached_property
    def fields(self) -> DisplacementField | None:
        """The displacement fields, counted by time in s; read when first asked for."""
        if self.sources.fields is None:
            return None
        return read_fields(self.sources.fields, self.noise.displacement_std)

    @property
    def observation_points(self) -> np.ndarray:
        """Where displacements are compared; (n, 2), m."""
        return self.observation.points(self.specimen)

    @property
    def stations(self) -> np.ndarray:
        """CMOD (m) at which displacements are compared, from the measured peak on."""
        return stations(self.need_curve(), self.observation.cmod_count, self.observation.cmod_step)

    @property
    def cmod_max(self) -> float:
        """CMOD (m) at which the simulated test ends: as set, or a tenth beyond the last station."""
        return self.loading.cmod_max or BEYOND * float(self.stations[-1])

    def need_curve(self) -> LoadCurve:
        """The record; refuses a bundle without one."""
        if self.curve is None:
            raise MissingFileError(f"load_cmod.csv is missing in {self.folder}: this needs the measured load and CMOD")
        return self.curve

    def need_fields(self) -> DisplacementField:
        """The displacement fields; refuses a bundle without a field file."""
        if self.fields is None:
            raise MissingFileError(f"fields.h5 is missing in {self.folder}: add it, or give --fields FILE")
        return self.fields

    def with_radius(self, radius: float) -> Bundle:
        """The same test for particles of another radius (m); f_max/(2 r t) of [start] is kept."""
        model = self.model.model_copy(update={"particle_radius_mm": radius / MM})
        start = self.start
        if start is not None:
            start = start.model_copy(update={"f_max_n": start.f_max_n * radius / self.model.radius})
        return replace(self, experiment=self.experiment.model_copy(update={"model": model, "start": start}))


def read_bundle(folder: Path, fields: Path | None = None, thorough: bool = False) -> Bundle:
    """Read a bundle.

    Parameters
    ----------
    folder : Path
    fields : Path; a field file that stands in for the bundle's own fields or images
    thorough : bool; decode every speckle image too, as `check` does

    Raises
    ------
    MissingFileError
        where there is no such folder
    BundleError
        with every problem of the bundle, each naming file, row or key, the rule and the remedy
    """
    bundle, problems = inspect_bundle(folder, fields, thorough)
    if bundle is None or problems:
        raise BundleError(problems)
    return bundle


def inspect_bundle(folder: Path, fields: Path | None = None, thorough: bool = False) -> tuple[Bundle | None, list[str]]:
    """The bundle, None where settings or specimen are faulty, and everything that is wrong.

    Arguments as of `read_bundle`; refuses only what is not a folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise MissingFileError(f"{folder} is not a folder: `cohesive-bpm new` makes a bundle")
    sources, problems = find_sources(folder, fields)
    raw, sections, found = _settings(folder)
    specimen, uncut = cut(sections.get("specimen"), raw.get("specimen"), found)
    problems = found + uncut + problems
    curve, found = read_load_cmod(sources.curve) if sources.curve else (None, [])
    time, late = frames.read_frames(sources.frames, sources.images) if sources.frames and sources.images else (None, [])
    creep, slow = parse_creep(sources.creep) if sources.creep else (None, [])
    problems += found + late + slow
    problems += material_problems(sections.get("material"), sources)
    problems += photograph_problems(sections.get("specimen"), specimen, sources)
    problems += speckle_problems(sections, specimen, sources, thorough)
    problems += record_problems(sections, specimen, curve, time)
    problems += field_file_problems(sections, specimen, sources, curve)
    if specimen is None or len(sections) < len(Experiment.model_fields):
        return None, problems
    experiment = Experiment.model_construct(**sections)
    return Bundle(folder, experiment, specimen, sources, _with_std(curve, experiment), time, creep), problems


def _settings(folder: Path) -> tuple[dict, dict, list[str]]:
    """Raw tables, sound sections and problems of experiment.toml."""
    try:
        raw = read_toml(folder / FILE)
    except MissingFileError as error:
        return {}, {}, [f"{error}: `cohesive-bpm new DIR` writes one to fill in"]
    except InputError as error:
        return {}, {}, [str(error)]
    return raw, *parse_experiment(raw)


def _with_std(curve: LoadCurve | None, experiment: Experiment) -> LoadCurve | None:
    """The record with the standard deviation of its load, as given or as estimated from it."""
    if curve is None:
        return None
    std = experiment.noise.load_std or estimate_load_noise(curve)
    return replace(curve, load_std=np.full(curve.load.shape, std))
