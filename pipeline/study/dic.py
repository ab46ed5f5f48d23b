"""Image correlation of a bundle: from speckle images to fields, crack, pictures."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.errors import MissingFileError, StoreError
from pipeline.dic.status import Status
from pipeline.execution.progress import Progress, Silent
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.correlations import Frame
from pipeline.store.fields import field_problems
from pipeline.store.layouts import DIC
from pipeline.store.results import prepare_output, read_arrays, read_result, write_arrays, write_result
from pipeline.study import gauge
from pipeline.study.assembly import settings_of
from pipeline.study.measurement import (
    Measurement,
    Series,
    correlate_series,
    correlation_settings,
    measure,
    measurement_key,
    write_measured_fields,
)
from pipeline.study.output import results_folder

FIELDS, FOLDER = "fields.h5", "dic"


@dataclass(frozen=True)
class Measured:
    """A bundle's fields, as they lie in a folder.

    Parameters
    ----------
    fields : Path; fields.h5 on the clock of the record
    result : what result.json says
    """

    fields: Path
    result: dict[str, Any]


def dic(
    bundle: Path,
    out: Path,
    *,
    subset_px: int | None = None,
    step_px: int | None = None,
    config: Path | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> str:
    """Correlate a bundle's images; writes fields.h5, result.json, results.h5, figures, report.

    Correlated images are kept in OUT/frames: the same call goes on where it stopped.

    Parameters
    ----------
    bundle, out : folders
    subset_px, step_px : instead of the bundle's [dic]
    workers : threads
    """
    settings = settings_of(config, subset_size_px=subset_px, grid_step_px=step_px, workers=workers)
    read = read_bundle(bundle)
    if not read.images:
        raise MissingFileError(f"{read.folder} holds no speckle images: add images/, frames.csv and [camera]")
    folder = results_folder(out, read)
    found = measured_fields(read, folder, settings, progress or Silent())
    return "\n".join([summary(found.result), *found.result["warnings"]])


def measured_fields(
    bundle: Bundle, folder: Path, settings: RunSettings, progress: Progress, page: bool = True
) -> Measured:
    """The fields of a bundle's images, from a folder where they lie already, else correlated into it.

    Parameters
    ----------
    bundle : Bundle with images
    folder : Path; of the results
    settings : RunSettings
    progress : Progress
    page : bool; whether figures and report.html are made
    """
    series = correlate_series(bundle, prepare_output(folder), correlation_settings(bundle, settings), progress)
    key = measurement_key(bundle, series)
    known = _finished(folder, key, page)
    if known is not None:
        return Measured(folder / FIELDS, known)
    progress.stage("crack, clock and noise")
    found = measure(bundle, series)
    write_measured_fields(folder / FIELDS, found)
    result = dic_result(bundle, found, key)
    write_arrays(folder, DIC, dic_arrays(found))
    if page:
        from pipeline.study.dic_page import dic_page

        progress.stage("drawing")
        dic_page(folder, bundle, found, result)
    write_result(folder, result)  # last: it says that all of this is whole
    return Measured(folder / FIELDS, result)


def with_measured_fields(bundle: Bundle, found: Measured) -> Bundle:
    """The bundle with measured fields in the place of its images."""
    return replace(bundle, sources=replace(bundle.sources, fields=found.fields, images=(), frames=None))


def _finished(folder: Path, key: str, page: bool) -> dict[str, Any] | None:
    """What result.json says, where it and the files beside it are whole and of these images."""
    with contextlib.suppress(MissingFileError, StoreError):
        result = read_result(folder)
        drawn = not page or (folder / "report.html").is_file()
        if result.get("key") == key and drawn and not field_problems(folder / FIELDS):
            read_arrays(folder, DIC)
            return result
    return None


def dic_result(bundle: Bundle, found: Measurement, key: str) -> dict[str, Any]:
    """The measurement by the keys of result.json."""
    series, timing = found.series, found.timing
    per_frame = (len(series) - 1) * series.grid.size
    return {
        "version": __version__,
        "command": "dic",
        "bundle": bundle.name,
        "key": key,
        "seconds": found.seconds,
        "frames": len(series),
        "subset_size_px": series.settings.subset_size_px,
        "grid_step_px": series.settings.grid_step_px,
        "points": int(np.count_nonzero(series.ever)),
        "valid_fraction": float(found.valid[1:].mean()),
        "split_fraction": float(found.split[-1]),
        "noise_px": found.noise_px,
        "noise_factor": found.noise_factor,
        "frames_at_rest": found.resting,
        "crack_tip_px": [None if np.isnan(tip[0]) else tip for tip in found.tip_px],
        "crack_tip_std_px": found.tip_std_px,
        "subsets_per_second": per_frame / found.seconds if found.seconds > 0 else float("nan"),
        "sync_offset_s": None if timing.how == "no record" else timing.offset,
        "sync_std_s": timing.std,
        "sync": gauge.sentence(timing),
        "status": reasons(series.frame(len(series) - 1)),
        "warnings": warnings(found),
    }


def reasons(frame: Frame) -> dict[str, int]:
    """How many points of a frame met each fate."""
    codes, counts = np.unique(frame.result.status, return_counts=True)
    return {Status(int(code)).name.lower(): int(count) for code, count in zip(codes, counts, strict=True)}


def warnings(found: Measurement) -> list[str]:
    """What a user should look at."""
    told = gauge.remarks(found.timing)
    if found.resting == 0:
        told.append(
            "the specimen moves from the first image on: the noise is the correlation's own estimate, not checked at "
            "rest; take a few images before the loading begins"
        )
    if found.noise_factor > 2:
        told.append(
            f"at rest the points scatter {found.noise_factor:.1f} times as much as camera noise explains: shaking, "
            "flickering light or hot air; the noise was raised to that"
        )
    if found.valid[1:].min() < 0.8:
        worst = 1 + int(np.argmin(found.valid[1:]))
        told.append(f"image {found.series.images[worst].name}: only {found.valid[worst]:.0%} of the points were found")
    return told


def dic_arrays(found: Measurement) -> dict[str, Any]:
    """The arrays of a measurement, by the names of layout `DIC`."""
    series, opening = found.series, found.timing.opening
    last = series.frame(len(series) - 1).result
    return {
        "points_px": series.grid.points,
        "points_m": series.view.point(series.grid.points),
        "frames/stamp_s": series.stamp,
        "frames/record_time_s": None if found.timing.how == "no record" else found.record_time,
        "frames/valid_fraction": found.valid,
        "frames/split_fraction": found.split,
        "frames/opening_m": opening and opening.value,
        "frames/opening_std_m": opening and opening.std,
        "frames/tip_px": found.tip_px,
        "frames/tip_std_px": found.tip_std_px,
        "frames/tip_m": series.view.point(found.tip_px),
        "last/displacement_m": series.view.vector(last.displacement),
        "last/std_px": last.std * found.noise_factor,
        "last/status": last.status,
        "last/znssd": last.znssd,
        **_profile(series),
    }


def _profile(series: Series) -> dict[str, Any]:
    """The crack in the last frame that has one, in m."""
    for number in range(len(series) - 1, 0, -1):
        crack = series.frame(number).crack
        if crack is not None:
            scale = series.view.metre_per_px
            lengths = {k: getattr(crack, k) * scale for k in ("arc", "opening", "sliding", "std", "closing")}
            return {"crack/path_m": series.view.point(crack.path), **{f"crack/{k}_m": v for k, v in lengths.items()}}
    return {}


def summary(result: dict[str, Any]) -> str:
    """What was measured, in a sentence."""
    tip = next((t for t in reversed(result["crack_tip_px"]) if t is not None), None)
    crack = "no crack stands out" if tip is None else f"crack tip at ({tip[0]:.0f}, {tip[1]:.0f}) px"
    return (
        f"{result['frames']} images, {result['points']} points, {result['valid_fraction']:.1%} valid; noise "
        f"{result['noise_px']:.4f} px; {crack}; {result['sync']}"
    )
