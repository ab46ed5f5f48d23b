"""What camera and machine write down of a specimen that engine C broke: the bundle of a case."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.blind.equilibrium import Path as Broken
from pipeline.blind.equilibrium import Setup
from pipeline.blind.record import MEASUREMENT, Camera, Recorder
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.dic.camera import View
from pipeline.dic.speckle import Camera as Lens
from pipeline.dic.speckle import Speckle, photograph
from pipeline.store.new import Contents, write_bundle
from pipeline.study.blind_check.cases import NOISE, Case, Size
from pipeline.study.blind_check.specimens import Drawn
from pipeline.study.photography import camera_frame, view_of
from pipeline.study.request import CAMERA_MM_PER_PX
from pipeline.study.typical_creep import creep_record

CLOSE = (0.3, 0.6)  # share of the loading, in which this share of the frames is taken
STILL = 4  # frames of the unloaded specimen
GRID, ROI = 1.6 * MM, 44 * MM  # of measured points
PIXEL_NOISE = 2.0  # grey values
BLUR = 0.6  # px


@dataclass(frozen=True, eq=False)
class Scene:
    """A surface of triangles before a camera: which material is seen at each pixel."""

    pixel: np.ndarray
    origin: np.ndarray
    raster: Any

    def origin_on(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Material points (n, 2), px, seen on a raster, and whether there is any."""
        found: tuple[np.ndarray, np.ndarray] = self.raster(self.pixel, self.origin, columns, rows)
        return found


def write_case(
    folder: Path, case: Case, drawn: Drawn, broken: tuple[Setup, Broken], size: Size, rng: np.random.Generator
) -> None:
    """The bundle of a case, with fields or images."""
    of_record, of_field, of_speckle, of_way = rng.spawn(4)
    noise_px, load_std = NOISE[case.noise]
    setup, path = broken
    e = drawn.experiment.model_copy(update={"name": case.name})
    displacement_std = noise_px * CAMERA_MM_PER_PX * MM
    shape, frame = camera_frame(drawn.specimen, size.camera_mm_per_px)
    view, points = view_of(frame), measuring_points(drawn.specimen)
    corners = view.point(np.array([(0, 0), (shape[1] - 1, shape[0] - 1)], float)) if case.images else points
    low, high = corners.min(axis=0), corners.max(axis=0)
    rate = drawn.experiment.loading.cmod_rate
    frames = size.pictures if case.images else size.frames
    times = taken(float(path.cmod[-1]) / rate, frames)
    camera = Camera(
        time=times,
        points=points,
        centre=(low + high) / 2,
        corner=float(np.hypot(*(high - low)) / 2),
        displacement_std=0.0 if case.images else displacement_std,
        load_std=load_std,
        rest=float(times[STILL - 1]),
        heading=float(of_way.uniform(0, 2 * np.pi)),
    )
    spoiling = {n: v for n, v in case.effects.items() if n in MEASUREMENT}
    recorder = Recorder(setup, path, drawn.specimen, camera, spoiling)
    noise = {"load_std_n": load_std} | ({} if case.images else {"displacement_std_mm": displacement_std / MM})
    e = e.model_copy(update={"noise": e.noise.model_copy(update={k: float(f"{v:.4g}") for k, v in noise.items()})})
    contents = Contents(recorder.curve(of_record), labels=drawn.labels, creep=creep_record(e))
    if case.images:
        of_dic = {"sync_offset_s": 0.0, "grid_step_px": size.step_px}
        e = e.model_copy(update={"camera": frame, "dic": e.dic.model_copy(update=of_dic)})
        pictures = film(recorder, view, shape, of_speckle)
        contents = replace(contents, images=pictures, frame_time=recorder.stamped())
    else:
        contents = replace(contents, fields=recorder.field(of_field))
    write_bundle(folder, e, contents)


def taken(duration: float, frames: int) -> np.ndarray:
    """Times (s) of frames: a few at rest, then closer while the load rises and falls than in the tail.

    Parameters
    ----------
    duration : float, s; of the loading
    frames : int; under load
    """
    early = round(CLOSE[1] * frames)
    knee = CLOSE[0] * duration
    soon, late = np.arange(1, early + 1) / early, np.arange(1, frames - early + 1) / (frames - early)
    loaded = np.concatenate([knee * soon, knee + (duration - knee) * late])
    rest: np.ndarray = np.concatenate([loaded[0] * np.arange(STILL), loaded[0] * (STILL - 1) + loaded])
    return rest


def film(recorder: Recorder, view: View, shape: tuple[int, int], rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Speckle images of a test, from the motion of its triangles."""
    of_pattern, of_noise = rng.spawn(2)
    speckle, lens = Speckle.scattered(shape, of_pattern), Lens(noise=PIXEL_NOISE, blur=BLUR)
    for time_ in recorder.camera.time.tolist():
        sheet = recorder.sheet(time_)
        scene = Scene(_pixels(view, sheet.seen), _pixels(view, sheet.material), sheet.raster)
        yield photograph(speckle, shape, scene, lens, of_noise)


def _pixels(view: View, corners: np.ndarray) -> np.ndarray:
    return view.pixel(corners.reshape(-1, 2)).reshape(corners.shape)


def measuring_points(specimen: Specimen) -> np.ndarray:
    """Grid (n, 2), m, of measured points around the tip, none on the notch line."""
    steps = (np.arange(int(ROI / GRID)) - int(ROI / GRID) / 2 + 0.5) * GRID
    x, y = np.meshgrid(steps, steps)
    points = np.column_stack([x.ravel(), y.ravel()]) + specimen.tip
    return points[specimen.contains(points)]
