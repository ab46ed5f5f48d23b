"""What a LAMMPS run left in its folder, read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.core.errors import StoreError
from pipeline.explicit.frames import Frame


def read_curve(path: Path) -> dict[str, np.ndarray]:
    """Columns of curve.txt by name."""
    with path.open(encoding="ascii") as lines:
        names = lines.readline().split()
        table = _numbers(lines.read(), len(names), path)
    if len(table) < 3:
        raise StoreError(f"{path} holds {len(table)} rows, expected at least 3: the run ended at its start")
    return dict(zip(names, table.T, strict=True))


def _numbers(text: str, columns: int, path: Path) -> np.ndarray:
    """The rows of a table of numbers."""
    try:
        return np.array(text.split(), float).reshape(-1, columns)
    except ValueError as error:
        raise StoreError(f"{path} is cut off or damaged ({error}): run the simulation again") from error


def read_frames(path: Path, count: int) -> list[Frame]:
    """All frames of frames.dump for `count` particles, sorted by particle."""
    text = path.read_text(encoding="ascii")
    return [_frame(part, count, path) for part in text.split("ITEM: TIMESTEP\n")[1:]]


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
