"""What a LAMMPS run left in its folder, read back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.errors import StoreError


@dataclass(frozen=True)
class Frame:
    """Positions and velocities (n, 2) of all particles at one step."""

    step: int
    position: np.ndarray
    velocity: np.ndarray


def read_curve(path: Path) -> dict[str, np.ndarray]:
    """Columns of curve.txt by name."""
    with path.open(encoding="ascii") as lines:
        names = lines.readline().split()
    table = np.loadtxt(path, skiprows=1, ndmin=2)
    if table.shape[1:] != (len(names),) or len(table) < 3:
        raise StoreError(f"{path} holds {table.shape} numbers, expected {len(names)} columns and at least 3 rows")
    return dict(zip(names, table.T, strict=True))


def read_frames(path: Path, count: int) -> list[Frame]:
    """All frames of frames.dump for `count` particles, sorted by particle."""
    text = path.read_text(encoding="ascii")
    return [_frame(part, count, path) for part in text.split("ITEM: TIMESTEP\n")[1:]]


def _frame(part: str, count: int, path: Path) -> Frame:
    head, _, body = part.partition("ITEM: ATOMS id x y vx vy\n")
    values = np.fromstring(body, sep=" ")
    if values.size != 5 * count:
        raise StoreError(f"{path} is cut off: a frame holds {values.size} numbers, expected {5 * count}")
    rows = values.reshape(count, 5)
    return Frame(int(head.split("\n", 1)[0]), rows[:, 1:3], rows[:, 3:5])


def read_reached(path: Path, pairs: np.ndarray) -> np.ndarray:
    """Largest opening (m,) in m of each bond of `pairs` (m, 2), from bonds.dump."""
    _, _, body = path.read_text(encoding="ascii").partition("ITEM: ENTRIES")
    rows = np.fromstring(body.partition("\n")[2], sep=" ").reshape(-1, 6)
    ends = np.sort(rows[:, 1:3].astype(np.int64) - 1, axis=1)
    size = int(pairs.max()) + 1
    key, wanted = ends @ [size, 1], np.sort(pairs, axis=1).astype(np.int64) @ [size, 1]
    order = np.argsort(key)
    at = np.searchsorted(key[order], wanted)
    if len(rows) != len(pairs) or not np.array_equal(key[order][at], wanted):
        raise StoreError(f"{path} does not hold the {len(pairs)} bonds of this problem")
    return rows[order[at], 4]
