"""Levelling: simulated fields before the same camera and through the same correlation as the measured ones."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.core.problem import Problem, Solution
from pipeline.dic.camera import View
from pipeline.dic.level import Levelling
from pipeline.dic.settings import Settings
from pipeline.inverse.objective import Objective
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import Bundle
from pipeline.store.layouts import LEVELLED
from pipeline.store.problem_key import problem_key
from pipeline.store.results import prepare_output
from pipeline.study.measurement import correlation_settings
from pipeline.study.photography import Sheet, view_of

FOLDER = "levelled"
AROUND = 3.0  # subsets that are photographed and matched around the points, so that cuts have sound neighbours


@dataclass(frozen=True, eq=False)
class Leveller:
    """Simulated tests as the camera and the correlation of a bundle would have seen them.

    Parameters
    ----------
    view : View; the measurement's camera
    settings : Settings; the measurement's correlation
    points : (p, 2) array, m; where fields are compared
    folder : Path; levelled fields are kept there
    engine : str; label of what simulates
    """

    view: View
    settings: Settings
    points: np.ndarray
    folder: Path
    engine: str

    def seen(self, problem: Problem, solution: Solution) -> np.ndarray:
        """Displacements (frames, p, 2) in m of the points in the frames of a solution; NaN where none was found."""
        path = self.path(problem)
        known = self._kept(path)
        if known is not None:
            return known
        found = self._levelled(problem, solution)
        write_atomically(path, LEVELLED.encode({"points_m": self.points, "displacement_m": found}))
        return found

    def path(self, problem: Problem) -> Path:
        """The file of a simulation, camera, correlation and points."""
        told = repr((__version__, self.view, replace(self.settings, threads=1), self.points.tolist()))
        key = hashlib.sha256((problem_key(problem, self.engine) + told).encode()).hexdigest()
        return self.folder / f"{key}.h5"

    def _kept(self, path: Path) -> np.ndarray | None:
        try:
            return LEVELLED.decode(path)["displacement_m"]
        except (MissingFileError, StoreError):  # absent, or not to be trusted: levelled again
            return None

    def _levelled(self, problem: Problem, solution: Solution) -> np.ndarray:
        view, shape = crop(self.view, self.points, self.settings)
        sheet = Sheet(problem, view)
        torn = [sheet.torn(moved) for moved in solution.displacement]
        camera = Levelling(shape, view, replace(self.settings, roi_px=None))
        field = camera.field_at(self.points, problem.particles.position, solution.displacement, solution.cmod, torn)
        return np.where(field.valid[..., None], field.displacement, np.nan)


def crop(view: View, points: np.ndarray, settings: Settings) -> tuple[View, tuple[int, int]]:
    """A part of the picture around the points (p, 2) in m, its grid in step with the whole picture's.

    Returns
    -------
    view : View of the part
    shape : (rows, columns), px
    """
    at = view.pixel(points)
    step, edge = settings.grid_step_px, settings.half + 3  # Grid.over begins so far from the border
    around = step * int(np.ceil(AROUND * settings.subset_size_px / step))
    low = at.min(axis=0) - around - edge
    columns, rows = (int(n) + 1 for n in np.ceil(np.ptp(at, axis=0) + 2 * (around + edge)))
    origin = (view.origin_px[0] - float(low[0]), view.origin_px[1] - float(low[1]))
    return replace(view, origin_px=origin), (rows, columns)


def leveller(bundle: Bundle, settings: RunSettings, points: np.ndarray, folder: Path, engine: str) -> Leveller:
    """What levels the simulations of a bundle; keeps them in FOLDER/levelled."""
    assert bundle.camera is not None
    view, how = view_of(bundle.camera), correlation_settings(bundle, settings)
    return Leveller(view, how, points, prepare_output(folder / FOLDER), engine)


def refuse_unlevelled(bundle: Bundle, settings: RunSettings, aim: Objective) -> None:
    """Refuse levelling where nothing could be levelled.

    Raises
    ------
    InputError
        where only loads are compared, or nothing says how the fields were measured
    """
    if not settings.levelling:
        return
    if aim is Objective.LOAD:
        raise InputError("levelling sends displacement fields through the correlation, objective = load compares none")
    if bundle.camera is None:
        raise InputError(
            "levelling needs to know how the fields were measured: give [camera] mm_per_px and origin_px, and [dic] "
            "subset_size_px and grid_step_px, in experiment.toml"
        )
