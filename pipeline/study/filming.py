"""A virtual test before a camera whose clock nobody has set: speckle images, their times, and the truth beside them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.dic.settings import Settings
from pipeline.execution.progress import Progress
from pipeline.store.experiment import Experiment
from pipeline.store.fields import stream_fields
from pipeline.store.new import Contents, write_bundle
from pipeline.study.photography import Film, Sheet, camera_frame, view_of
from pipeline.twin.virtual_test import VirtualTest

LATEST = 4.0  # s; the camera's clock is off by up to so much, either way
STILL = 4  # images of the unloaded specimen, further to the last one before the loading: what noise is, at rest
TRUTH_FIELDS = "truth.h5"  # beside truth.json


@dataclass(frozen=True)
class Clock:
    """How the camera's time lies against the record's.

    Parameters
    ----------
    offset : float, s; an image stamped t was taken at record time t − offset
    phase : float; share of their distance by which images are earlier than the start of the loading
    before : int; images of the unloaded specimen, further to the last one before the loading
    """

    offset: float = 0.0
    phase: float = 0.0
    before: int = 0


def draw_clock(rng: np.random.Generator) -> Clock:
    """A camera's clock, which nobody has set."""
    late, phase = rng.uniform(-LATEST, LATEST), rng.uniform()
    return Clock(float(f"{late:.6g}"), float(f"{phase:.6g}"), STILL)


def film_of(test: VirtualTest, experiment: Experiment, mm_per_px: float, noise: float) -> tuple[Film, Experiment]:
    """What a camera sees of a test, and the settings with the camera in them.

    Parameters
    ----------
    test : VirtualTest
    experiment : Experiment
    mm_per_px : float, mm
    noise : float, grey values
    """
    shape, frame = camera_frame(test.problem.specimen, mm_per_px)
    still = int(np.count_nonzero(test.field.abscissa <= test.loading_begins))
    film = Film(Sheet(test.problem, view_of(frame)), shape, test.solution.displacement, still, noise)
    return film, experiment.model_copy(update={"camera": frame})


def write_film(
    out: Path,
    film: Film,
    experiment: Experiment,
    test: VirtualTest,
    clock: Clock,
    rng: np.random.Generator,
    workers: int | None,
    progress: Progress,
) -> None:
    """Photograph a test into a bundle, frame by frame, with the exact displacements in truth.h5 beside it."""
    for old in (out / "images").glob("frame_*.png"):  # of a virtual test that was stopped
        old.unlink()
    time, threads = test.field.abscissa, workers or Settings().threads
    progress.stage(f"photographing it: {len(film)} images of {film.shape[1]} × {film.shape[0]} px")
    progress.begin(len(film), 0, "image")
    pictures = told(film.pictures(rng, threads), progress)
    write_bundle(out, experiment, Contents(test.curve, images=pictures, frame_time=time + clock.offset))
    progress.stage("writing its exact displacements")
    grid = Settings(subset_size_px=experiment.dic.subset_size_px, grid_step_px=experiment.dic.grid_step_px)
    points, frames = film.truth(grid)
    stream_fields(out / TRUTH_FIELDS, points, time, frames)


def told(pictures: Iterator[np.ndarray], progress: Progress) -> Iterator[np.ndarray]:
    """The pictures, each counted when the next is asked for."""
    for number, picture in enumerate(pictures):
        yield picture
        progress.done(f"image {number}")
