"""Correlated frames on disk: one file each, found by what was correlated."""

from __future__ import annotations

import contextlib
import hashlib
import logging
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.errors import MissingFileError, StoreError
from pipeline.dic.correlation import Correlation
from pipeline.dic.crack import Crack
from pipeline.dic.grid import Grid
from pipeline.store.atomic import refused, write_atomically
from pipeline.store.layouts import DIC_FRAME
from pipeline.store.schema import opened, text_of

log = logging.getLogger("pipeline.store")

_CRACK = {"path": "path_px", "arc": "arc_px", "normal": "normal", "opening": "opening_px", "sliding": "sliding_px"}
_CRACK |= {"std": "std_px", "closing": "closing_px", "tip": "tip_px", "tip_std": "tip_std_px", "through": "through"}


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a series, correlated.

    Parameters
    ----------
    number : int; frame 0 is the reference
    result : Correlation from frame 0
    crack : Crack in px, or None
    base, sound : state of the `Tracker` after it
    seconds : float; of the correlation
    """

    number: int
    result: Correlation
    crack: Crack | None
    base: int
    sound: float
    seconds: float


def chained_keys(settings: str, images: Iterable[Path]) -> list[str]:
    """A key a frame: SHA-256 of the settings and of the bytes of all images up to it.

    A series that grows, or whose end was exchanged, keeps the keys of what stayed in front.
    """
    total, keys = hashlib.sha256(settings.encode()), []
    for image in images:
        try:
            total.update(hashlib.sha256(image.read_bytes()).digest())
        except OSError as error:
            raise StoreError(f"{image.name}: cannot be read ({error.strerror})") from None
        keys.append(total.hexdigest())
    return keys


class FrameStore:
    """Frames in a folder, one HDF5 file each (layout `DIC_FRAME`), named by their number.

    A file that cannot be trusted, or that belongs to other images or settings, counts as absent and is written over.

    Parameters
    ----------
    folder : Path; made if it does not exist
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise refused(self.folder, error) from error

    def path(self, number: int) -> Path:
        """The file of a frame."""
        return self.folder / f"{number:05d}.h5"

    def get(self, number: int, key: str) -> Frame | None:
        """The frame, None where there is none that can be trusted."""
        path = self.path(number)
        try:
            values = DIC_FRAME.decode(path)
        except MissingFileError:
            return None
        except StoreError as error:
            log.warning("%s; it is moved aside and correlated again", error)
            with contextlib.suppress(OSError):
                path.replace(path.with_suffix(".h5.damaged"))
            return None
        return _frame(values) if values["key"] == key else None

    def need(self, number: int, key: str) -> Frame:
        """The frame; refuses where it cannot be read back."""
        frame = self.get(number, key)
        if frame is None:
            raise StoreError(f"{self.path(number)} cannot be read back: give the same command again")
        return frame

    def status(self, number: int, key: str) -> np.ndarray:
        """What became of the points of a frame (n,), without reading the rest; refuses as `need` does."""
        try:
            with opened(self.path(number)) as file:
                if text_of(file, "key") == key:
                    return file["status"][()]
        except (OSError, KeyError, RuntimeError):  # also MissingFileError and StoreError
            pass
        return self.need(number, key).result.status

    def put(self, key: str, frame: Frame) -> None:
        """Keep a frame; raises StoreError where it cannot be written."""
        write_atomically(self.path(frame.number), DIC_FRAME.encode(_values(key, frame)))

    def kept(self, keys: list[str]) -> int:
        """How many frames after the reference are kept, one after the other; `keys` from frame 0 on."""
        for number, key in enumerate(keys[1:], start=1):
            if self._key(number) != key:
                return number - 1
        return len(keys) - 1

    def _key(self, number: int) -> str | None:
        """The key that a file says it has, without reading the rest."""
        try:
            with opened(self.path(number)) as file:
                return text_of(file, "key")
        except OSError:  # also MissingFileError and StoreError
            return None


def as_kept(result: Correlation) -> Correlation:
    """A result as it comes back from its file: real numbers in single precision, 6e-8 relative."""
    names = ("warp", "znssd", "std", "level", "line", "far", "jump", "jump_std")
    return replace(result, **{name: getattr(result, name).astype(np.float32).astype(float) for name in names})


def _values(key: str, frame: Frame) -> dict[str, Any]:
    r = frame.result
    crack = {} if frame.crack is None else {f"crack/{name}": getattr(frame.crack, k) for k, name in _CRACK.items()}
    return crack | {
        "key": key,
        "number": frame.number,
        "base": frame.base,
        "sound": frame.sound,
        "seconds": frame.seconds,
        "noise_grey": r.noise,
        "columns_px": r.grid.columns,
        "rows_px": r.grid.rows,
        "warp": r.warp,
        "status": r.status,
        "znssd": r.znssd,
        "iterations": r.iterations,
        "std_px": r.std,
        "level": r.level,
        "line": r.line,
        "far": r.far,
        "jump_px": r.jump,
        "jump_std_px": r.jump_std,
    }


def _frame(values: dict[str, Any]) -> Frame:
    result = Correlation(
        grid=Grid(values["columns_px"].astype(int), values["rows_px"].astype(int)),
        warp=values["warp"].astype(float),
        status=values["status"],
        znssd=values["znssd"].astype(float),
        iterations=values["iterations"].astype(int),
        std=values["std_px"].astype(float),
        level=values["level"].astype(float),
        line=values["line"].astype(float),
        far=values["far"].astype(float),
        jump=values["jump_px"].astype(float),
        jump_std=values["jump_std_px"].astype(float),
        noise=values["noise_grey"],
    )
    crack = None
    if values["crack/path_px"] is not None:
        parts = {k: values[f"crack/{name}"] for k, name in _CRACK.items()}
        parts |= {"tip_std": float(parts["tip_std"]), "through": bool(parts["through"])}
        crack = Crack(**parts)
    return Frame(values["number"], result, crack, values["base"], values["sound"], values["seconds"])
