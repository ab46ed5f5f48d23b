"""images/ with frames.csv: speckle images and when each was taken."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from pipeline.core.errors import PipelineError
from pipeline.store.images import SUFFIXES, image_size, read_grey
from pipeline.store.tables import shortened

FOLDER, FILE = "images", "frames.csv"


def image_files(folder: Path) -> tuple[Path, ...]:
    """PNG and TIFF files of a folder, sorted by name; hidden ones left out."""
    found = (p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.startswith("."))
    return tuple(sorted(found, key=lambda path: path.name))


def read_frames(path: Path, images: tuple[Path, ...]) -> tuple[np.ndarray | None, list[str]]:
    """Time (s) of each image, and one sentence for each problem.

    `frame` is the image's file name, or its number in the sorted list, counted from 0 or from 1.
    """
    try:
        rows = list(csv.reader(path.read_text("utf-8-sig").splitlines()))
    except OSError as error:
        return None, [f"{path.name}: cannot be read ({error.strerror}): images need their times"]
    except UnicodeDecodeError:
        return None, [f"{path.name}: is not UTF-8 text: export it again as plain CSV"]
    rows = [[cell.strip() for cell in row] for row in rows if row]
    if not rows or rows[0] != ["frame", "time_s"]:
        return None, [f"{path.name}: the header must be frame,time_s"]
    if len(rows) - 1 != len(images):
        return None, [f"{path.name}: has {len(rows) - 1} rows for {len(images)} images: every image needs one row"]
    names = [row[0] for row in rows[1:]]
    problems = _order_problems(path.name, names, images) + _time_problems(path.name, rows[1:])
    return (None, problems) if problems else (np.array([float(row[1]) for row in rows[1:]]), [])


def frames_csv(images: tuple[str, ...], time: np.ndarray) -> bytes:
    """The content of frames.csv."""
    rows = (f"{name},{moment:.12g}" for name, moment in zip(images, time.tolist(), strict=True))
    return ("\n".join(["frame,time_s", *rows]) + "\n").encode()


def image_problems(images: tuple[Path, ...], thorough: bool) -> list[str]:
    """Images that cannot be read or differ in size; `thorough` decodes every pixel."""
    problems, sizes = [], {}
    for image in images:
        try:
            sizes[image.name] = image_size(image)
            if thorough:
                problems += _blank(image.name, read_grey(image))
        except PipelineError as error:
            problems.append(f"{FOLDER}/{error}")
    first = next(iter(sizes.values()), None)
    odd = [
        f"{FOLDER}/{n}: has {c} × {r} pixels, the first image {first[1]} × {first[0]}: all must be alike"
        for n, (r, c) in sizes.items()
        if first and (r, c) != first
    ]
    return shortened(problems, "images") + shortened(odd, "images")


def _blank(name: str, grey: np.ndarray) -> list[str]:
    if np.ptp(grey):
        return []
    return [f"{FOLDER}/{name}: is blank (every pixel has the grey value {grey.flat[0]:g}): leave it out, with its time"]


def _order_problems(file: str, names: list[str], images: tuple[Path, ...]) -> list[str]:
    """Frames that are not the images one after the other."""
    by_number = all(name.isdecimal() for name in names)
    start = int(names[0]) if by_number and names else 0
    wanted = [str(start + i) for i in range(len(images))] if by_number else [image.name for image in images]
    given = [str(int(name)) for name in names] if by_number else names
    if by_number and start not in (0, 1):
        return [f"{file}: row 2: frame = {start}: frames are numbered from 0 or from 1"]
    wrong = [i for i, (a, b) in enumerate(zip(given, wanted, strict=True)) if a != b]
    if not wrong:
        return []
    return [f"{file}: row {wrong[0] + 2}: frame = {names[wrong[0]]}, the images sorted by name have {wanted[wrong[0]]}"]


def _time_problems(file: str, rows: list[list[str]]) -> list[str]:
    """Times that are no numbers or do not increase."""
    times, faults = [], []
    for line, row in enumerate(rows, start=2):
        try:
            times.append(float(row[1]))
        except (ValueError, IndexError):
            times.append(np.nan)
        if not np.isfinite(times[-1]):
            faults.append(f"row {line}: time_s = '{','.join(row[1:])}' is not a finite number")
        elif len(times) > 1 and times[-1] <= times[-2]:
            faults.append(
                f"row {line}: time_s = {times[-1]:.12g} must be larger than {times[-2]:.12g} in the row before"
            )
    return [f"{file}: {fault}" for fault in shortened(faults)]
