"""From speckle images to displacement fields on the clock of the load record; done once, found again."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.errors import ConvergenceError, InputError, MissingFileError
from pipeline.core.field import DisplacementField, rigid_motion
from pipeline.dic.camera import View
from pipeline.dic.correlation import Correlation
from pipeline.dic.crack import Crack, find_crack
from pipeline.dic.grid import Grid
from pipeline.dic.settings import Settings
from pipeline.dic.status import Status
from pipeline.dic.track import Tracker
from pipeline.execution.progress import Progress
from pipeline.store.bundle import Bundle
from pipeline.store.correlations import Frame, FrameStore, as_kept, chained_keys
from pipeline.store.fields import stream_fields
from pipeline.store.images import read_grey
from pipeline.store.results import prepare_output
from pipeline.study.gauge import NotchGauge, Opening, Timing, synchronised
from pipeline.study.photography import view_of

FRAMES = "frames"
SHAKY = 3.0  # a first frame whose points scatter more than so many times as expected is not at rest
GROWTH = 1.1  # … and the others are while their scatter is not so many times that of the calmest before them
AT_REST = 2  # frames at rest that make the noise known


@dataclass(frozen=True, eq=False)
class Series:
    """A bundle's speckle images, correlated; the frames are read from disk one at a time.

    Parameters
    ----------
    images : files, the first unloaded
    stamp : (frames,) array, s; their times as frames.csv has them
    view : View
    settings : Settings
    grid : Grid
    store : FrameStore
    keys : one a frame
    """

    images: tuple[Path, ...]
    stamp: np.ndarray
    view: View
    settings: Settings
    grid: Grid
    store: FrameStore
    keys: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.images)

    def frame(self, number: int) -> Frame:
        """A frame after the reference."""
        return self.store.need(number, self.keys[number])

    def frames(self) -> Iterator[Frame]:
        """All frames after the reference, one in memory at a time."""
        return (self.frame(number) for number in range(1, len(self)))

    @cached_property
    def ever(self) -> np.ndarray:
        """(n,) bool; points that have a result in any frame: the others lie beside the specimen."""
        found = np.zeros(self.grid.size, bool)
        for number, key in enumerate(self.keys[1:], start=1):
            found |= self.store.status(number, key) <= Status.SPLIT
        return found


def correlation_settings(bundle: Bundle, run: RunSettings) -> Settings:
    """How a bundle's images are correlated: as [dic] says, settings of the run over it."""
    own = bundle.dic
    settings = Settings(
        subset_size_px=run.subset_size_px or own.subset_size_px,
        grid_step_px=run.grid_step_px or own.grid_step_px,
        roi_px=own.roi_px,
        search_px=run.search_px,
    )
    return replace(settings, threads=run.workers) if run.workers else settings


def correlate_series(bundle: Bundle, folder: Path, settings: Settings, progress: Progress) -> Series:
    """Follow the points of a bundle's first image through the others.

    Finished frames are kept in FOLDER/frames: the same call goes on where it stopped.

    Parameters
    ----------
    bundle : Bundle with images
    folder : Path
    settings : Settings
    progress : Progress

    Raises
    ------
    InputError, ConvergenceError
        naming the image that cannot be used, or in which nothing is found again
    """
    if not bundle.images or bundle.camera is None or bundle.frame_time is None:
        raise MissingFileError(f"{bundle.folder} holds no speckle images: add images/, frames.csv and [camera]")
    if len(bundle.images) < 2:
        raise InputError("images/: holds one image: add those of the test, the first is the unloaded reference")
    store = FrameStore(prepare_output(folder / FRAMES))
    keys = chained_keys(_told(settings), bundle.images)
    first = _picture(bundle.images[0])
    with _named(bundle.images[0]):
        tracker = Tracker(first, settings)
    view = view_of(bundle.camera)
    series = Series(bundle.images, bundle.frame_time, view, settings, tracker.grid, store, tuple(keys))
    kept = store.kept(keys)
    progress.stage(f"correlating {len(keys)} images, {tracker.grid.size} points of {settings.subset_size_px} px each")
    progress.begin(len(keys) - 1, kept, "image")
    mouth = view.pixel(np.zeros((1, 2)))[0]
    if kept:
        _resume(tracker, series, kept)
    for number in range(kept + 1, len(keys)):
        store.put(keys[number], _followed(tracker, series.images[number], mouth))
        progress.done(series.images[number].name)
    return series


def _told(settings: Settings) -> str:
    """The settings as they stand in a key; threads change nothing."""
    return json.dumps(vars(replace(settings, threads=1)) | {"version": __version__}, sort_keys=True)


def _picture(image: Path) -> np.ndarray:
    try:
        return read_grey(image)
    except (InputError, MissingFileError) as error:
        raise InputError(f"images/{error}") from error


@contextmanager
def _named(image: Path) -> Iterator[None]:
    """Begin every refusal with the name of the image it is about."""
    try:
        yield
    except (InputError, ConvergenceError) as error:
        raise type(error)(f"images/{image.name}: {error}") from error


def _followed(tracker: Tracker, image: Path, mouth: np.ndarray) -> Frame:
    """The next frame of a series, and the crack in it."""
    began = time.perf_counter()
    picture = _picture(image)
    with _named(image):
        result = as_kept(tracker.follow(picture))
    tracker.keep(result)
    seconds = time.perf_counter() - began
    return Frame(tracker.number, result, crack_of(result, mouth), tracker.base, tracker.sound, seconds)


def _resume(tracker: Tracker, series: Series, kept: int) -> None:
    """Bring the tracker to where it stood after the last frame that is kept."""
    last = series.frame(kept)
    earlier = series.frame(kept - 1).result if kept > 1 else None
    base = None
    if last.base:
        base = (last.base, _picture(series.images[last.base]), series.frame(last.base).result)
    tracker.resume(kept, (_picture(series.images[kept]), last.result), earlier, base, last.sound)


def crack_of(result: Correlation, mouth: np.ndarray) -> Crack | None:
    """The crack in a frame, in px, from the end nearest to the mouth (2,) on; None where none stands out.

    A step across which the field closes more than it slides is no crack, but noise or a fold of the field. A tip beyond
    the field is moved to its border.
    """
    try:
        found = find_crack(result.points, np.nan_to_num(result.displacement), result.valid, mouth=mouth)
    except (ConvergenceError, InputError):  # no crack, or a field too small to show one
        return None
    opening, sliding = (float(np.nanmedian(v)) for v in (found.opening, found.sliding))
    if opening < 0 and abs(sliding) < -opening:
        return None
    tip = np.clip(found.tip, result.points.min(axis=0), result.points.max(axis=0))
    return replace(found, tip=tip, path=np.vstack([found.path[:-1], tip]))


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a series of images says.

    Parameters
    ----------
    series : Series
    timing : Timing; the clock, and the opening it was found by
    noise_factor : float; by which the standard deviations of the correlation were multiplied
    resting : int; frames at rest that it comes from, the reference not counted
    noise_px : float; median standard deviation of one displacement component
    valid, split : (frames,) arrays; shares of the points that ever had a result
    tip_px : (frames, 2) array; NaN where no crack stands out
    tip_std_px : (frames,) array
    seconds : float; of the correlation
    """

    series: Series
    timing: Timing
    noise_factor: float
    resting: int
    noise_px: float
    valid: np.ndarray
    split: np.ndarray
    tip_px: np.ndarray
    tip_std_px: np.ndarray
    seconds: float

    @property
    def record_time(self) -> np.ndarray:
        """(frames,) array, s, on the clock of the record."""
        return self.series.stamp - self.timing.offset


def measure(bundle: Bundle, series: Series) -> Measurement:
    """Opening, clock, noise, crack tips of a correlated series.

    Raises
    ------
    InputError, ConvergenceError
        where frames and record cannot be brought to one clock
    """
    count, ever = len(series), np.count_nonzero(series.ever)
    scatter, predicted, usual = np.zeros(count), np.ones(count), np.zeros(count)
    valid, split = np.ones(count), np.zeros(count)
    tip, tip_std, seconds = np.full((count, 2), np.nan), np.full(count, np.nan), 0.0
    gauge, opened = NotchGauge.of(bundle.specimen, series), np.zeros((count, 2))
    for frame in series.frames():
        r, k = frame.result, frame.number
        valid[k], split[k] = np.count_nonzero(r.valid) / ever, np.count_nonzero(r.split) / ever
        scatter[k], predicted[k] = rest_scatter(r)
        usual[k] = np.median(r.std[r.valid])
        opened[k] = gauge.opening(r) if gauge else (0.0, 0.0)
        seconds += frame.seconds
        if frame.crack is not None:
            tip[k], tip_std[k] = frame.crack.tip, frame.crack.tip_std
    resting = frames_at_rest(scatter[1:] / predicted[1:])
    factor = 1.0
    if resting >= AT_REST:
        still = slice(1, resting + 1)
        factor = float(np.sqrt(np.sum(scatter[still] ** 2) / np.sum(predicted[still] ** 2)))
    seen = None if gauge is None else Opening(opened[:, 0], factor * opened[:, 1], gauge.arms is None)
    timing = synchronised(bundle, series.stamp, seen)
    noise = factor * float(np.median(usual[1:]))
    return Measurement(series, timing, factor, resting, noise, valid, split, tip, tip_std, seconds)


def frames_at_rest(ratio: np.ndarray) -> int:
    """How many frames after the reference are at rest, from scatter over expected scatter (frames,)."""
    if not ratio.size or ratio[0] > SHAKY:
        return 0
    calmest = np.minimum.accumulate(ratio)
    moving = np.flatnonzero(ratio[1:] > GROWTH * calmest[:-1])
    return 1 + int(moving[0]) if moving.size else int(ratio.size)


def rest_scatter(result: Correlation) -> tuple[float, float]:
    """Robust scatter of the displacements without rigid motion, and what the correlation expects, both px."""
    moved = np.nan_to_num(result.displacement)
    left = (moved - rigid_motion(result.points, moved, result.valid))[result.valid]
    spread = 1.4826 * np.median(np.abs(left - np.median(left, axis=0)), axis=0)
    return float(np.sqrt(np.mean(spread**2))), float(np.sqrt(np.mean(np.median(result.std[result.valid] ** 2, axis=0))))


def write_measured_fields(path: Path, measurement: Measurement) -> None:
    """fields.h5: all points that ever had a result, on the clock of the record."""
    series = measurement.series
    keep = series.ever
    points = series.view.point(series.grid.points[keep])

    def frames() -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        yield np.zeros(points.shape), np.ones(len(points), bool), np.zeros(len(points))
        for frame in series.frames():
            field = frame_field(series, frame.result, measurement.noise_factor)
            yield field.displacement[0, keep], field.valid[0, keep], np.nan_to_num(field.std[0, keep])

    stream_fields(path, points, measurement.record_time, frames())


def frame_field(series: Series, result: Correlation, factor: float) -> DisplacementField:
    """One frame in specimen coordinates, m, with the noise as it was found."""
    field = result.field(series.view)
    return replace(field, std=field.std * factor)


def measurement_key(bundle: Bundle, series: Series) -> str:
    """SHA-256 of everything that the fields of a series depend on."""
    curve = bundle.curve
    record = b"" if curve is None else curve.time.tobytes() + curve.cmod.tobytes()
    rest = repr((series.keys[-1], series.view, bundle.dic.sync_offset_s, bundle.specimen, series.stamp.tolist()))
    return hashlib.sha256(rest.encode() + record).hexdigest()
