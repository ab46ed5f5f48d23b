"""What a LAMMPS run left in its folder, read back.

A run that was killed and went on from its restart file of step S leaves parts: curve.txt and frames.dump up to the
kill, curve-S.txt and frames-S.dump from S on. What a part holds behind the step at which the next one begins is void.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from pipeline.core.errors import StoreError
from pipeline.explicit.frames import Frame


def parts(path: Path) -> list[tuple[Path, float]]:
    """The parts of an output file in the order of the run, each with the step behind which it is void."""
    begins = {0: path}
    for part in path.parent.glob(f"{path.stem}-*{path.suffix}"):
        if found := re.fullmatch(rf"{path.stem}-([1-9]\d*)", part.stem):
            begins[int(found[1])] = part
    order = sorted(begins)
    return [(begins[k], end) for k, end in zip(order, [*order[1:], math.inf], strict=True)]


def read_curve(path: Path) -> dict[str, np.ndarray]:
    """Columns of curve.txt and its parts by name, one row a record."""
    rows: dict[float, np.ndarray] = {}
    for part, end in parts(path):
        names, table = _table(part, end)
        rows |= {row[0]: row for row in table if row[0] <= end and row[0] not in rows}
    if len(rows) < 3:
        raise StoreError(f"{path} holds {len(rows)} rows, expected at least 3: the run ended at its start")
    table = np.array([rows[step] for step in sorted(rows)])
    return dict(zip(names, table.T, strict=True))


def _table(path: Path, end: float) -> tuple[list[str], np.ndarray]:
    """Names and rows of one part; its last line may be cut off where the part is void there."""
    names, _, text = path.read_text(encoding="ascii").partition("\n")
    if end < math.inf:
        text = text[: text.rfind("\n") + 1]
    return names.split(), _numbers(text, len(names.split()), path)


def _numbers(text: str, columns: int, path: Path) -> np.ndarray:
    """The rows of a table of numbers."""
    try:
        return np.array(text.split(), float).reshape(-1, columns)
    except ValueError as error:
        raise StoreError(f"{path} is cut off or damaged ({error}): run the simulation again") from error


def read_frames(path: Path, count: int) -> list[Frame]:
    """All frames of frames.dump and its parts for `count` particles, sorted by particle."""
    frames: dict[int, Frame] = {}
    for part, end in parts(path):
        for text in part.read_text(encoding="ascii").split("ITEM: TIMESTEP\n")[1:] if part.exists() else ():
            step, newline, _ = text.partition("\n")
            if end < math.inf and not (newline and int(step) <= end):
                break
            frames.setdefault(int(step), _frame(text, count, part))
    if not path.exists():
        raise StoreError(f"{path} does not exist: run the simulation again")
    return [frames[step] for step in sorted(frames)]


def _frame(part: str, count: int, path: Path) -> Frame:
    head, _, body = part.partition("ITEM: ATOMS id x y vx vy\n")
    rows = _numbers(body, 5, path)
    if len(rows) != count:
        raise StoreError(f"{path} is cut off: a frame holds {len(rows)} particles, expected {count}")
    return Frame(int(head.split("\n", 1)[0]), rows[:, 1:3], rows[:, 3:5])


def read_reached(path: Path, pairs: np.ndarray) -> np.ndarray:
    """Largest opening (m,) in m of each bond of `pairs` (m, 2), from bonds.dump."""
    _, _, body = path.read_text(encoding="ascii").partition("ITEM: ENTRIES")
    rows = _numbers(body.partition("\n")[2], 6, path)
    ends = np.sort(rows[:, 1:3].astype(np.int64) - 1, axis=1)
    size = int(pairs.max()) + 1
    key, wanted = ends @ [size, 1], np.sort(pairs, axis=1).astype(np.int64) @ [size, 1]
    order = np.argsort(key)
    at = np.searchsorted(key[order], wanted)
    if len(rows) != len(pairs) or not np.array_equal(key[order][at], wanted):
        raise StoreError(f"{path} does not hold the {len(pairs)} bonds of this problem")
    return rows[order[at], 4]


def read_stretched(path: Path, pairs: np.ndarray) -> np.ndarray:
    """Length, undeformed and relaxed length (m, 3) in m of each bond of `pairs`; NaN where it has parted."""
    _, _, body = path.read_text(encoding="ascii").partition("ITEM: ENTRIES")
    rows = _numbers(body.partition("\n")[2], 6, path)
    ends = np.sort(rows[:, 1:3].astype(np.int64) - 1, axis=1)
    place = {(i, j): k for k, (i, j) in enumerate(np.sort(pairs, axis=1).tolist())}
    found = np.full((len(pairs), 3), np.nan)
    for (i, j), row in zip(ends.tolist(), rows, strict=True):
        if (i, j) not in place:
            raise StoreError(f"{path} holds a bond of {i + 1} and {j + 1}, which is none of this problem's")
        found[place[i, j]] = row[3:]
    return found
