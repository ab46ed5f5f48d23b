"""Ways to spoil the files of a bundle."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import cv2
import h5py
import numpy as np

DAMAGE = Callable[[Path], object]


def cut_off(name: str, size: int) -> DAMAGE:
    """Leave so many bytes of a file."""
    return lambda bundle: os.truncate(bundle / name, size)


def filled(name: str, content: bytes) -> DAMAGE:
    """Write something else into a file."""
    return lambda bundle: (bundle / name).write_bytes(content)


def folder_instead(name: str) -> DAMAGE:
    """Put a folder in the place of a file."""

    def damage(bundle: Path) -> None:
        (bundle / name).unlink(missing_ok=True)
        (bundle / name).mkdir()

    return damage


def photograph(image: np.ndarray, name: str = "specimen.png") -> DAMAGE:
    """Put a photograph in the place of the label image."""

    def damage(bundle: Path) -> None:
        (bundle / "labels.png").unlink()
        cv2.imwrite(str(bundle / name), image)

    return damage


def labels(value: int) -> DAMAGE:
    """Label all pixels alike."""
    return lambda bundle: cv2.imwrite(str(bundle / "labels.png"), np.full((121, 275), value, np.uint8))


def rows(change: Callable[[list[str]], list[str]]) -> DAMAGE:
    """Change the table of the record, header first."""

    def damage(bundle: Path) -> None:
        path = bundle / "load_cmod.csv"
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")

    return damage


def row_8(cmod: str | None = None, load: str | None = None) -> DAMAGE:
    """Write something else into one row of the record."""

    def change(table: list[str]) -> list[str]:
        cells = table[7].split(",")
        return [*table[:7], f"{cells[0]},{cmod if cmod is not None else cells[1]},{load or cells[2]}", *table[8:]]

    return rows(change)


def field(name: str, change: Callable[[np.ndarray], np.ndarray]) -> DAMAGE:
    """Replace a dataset of fields.h5."""

    def damage(bundle: Path) -> None:
        with h5py.File(bundle / "fields.h5", "r+") as file:
            values, attributes = file[name][()], dict(file[name].attrs)
            del file[name]
            file[name] = change(values)
            file[name].attrs.update(attributes)

    return damage
