"""Image files: photographs, speckle images and label images, PNG or TIFF."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from pipeline.core.errors import InputError, MissingFileError
from pipeline.store.atomic import write_atomically
from pipeline.store.png import SIGNATURE, png_size, read_png
from pipeline.store.raster import MAX_BYTES, Raster
from pipeline.store.tiff import read_tiff, tiff_size

SUFFIXES = (".png", ".tif", ".tiff")
LUMINANCE = np.array([0.299, 0.587, 0.114], np.float32)  # of red, green, blue: ITU-R BT.601
LABELS = 4  # outside, mastic, aggregate, void

T = TypeVar("T")


def read_grey(path: Path, page: int | None = None) -> np.ndarray:
    """Grey levels (rows, columns), float32, of an image of 8 or 16 bits or floats, grey, colour or palette.

    Levels are those of the file (12 bits in 16 stay below 4096); colours become luminance (BT.601), an
    alpha channel is left out.

    Parameters
    ----------
    path : Path
    page : int; of a TIFF with several pages, counted from 0; without it such a file is refused

    Raises
    ------
    MissingFileError, InputError
        naming the file where it is missing, unreadable, truncated, empty, too large or has several pages
    """
    pixels = _decoded(path, page).coloured()
    if pixels.ndim == 3:
        pixels = pixels[:, :, :3].astype(np.float32) @ LUMINANCE
    grey = pixels.astype(np.float32, copy=False)
    if not np.isfinite(grey).all():
        raise InputError(f"{path.name}: some grey levels are NaN or infinite: export the image with 8 or 16 bits")
    return grey


def read_labels(path: Path) -> np.ndarray:
    """Labels (rows, columns), uint8: 0 outside, 1 mastic, 2 aggregate, 3 void.

    A palette image gives the numbers of its palette, so a label image may be coloured for the eye.
    Refuses what `read_grey` refuses, colours, and other values.
    """
    pixels = _decoded(path, None).pixels
    if pixels.ndim != 2:
        raise InputError(f"{path.name}: is a colour image, labels are one number a pixel: save it as 8-bit grey")
    values = np.unique(pixels)
    if not np.isin(values, np.arange(LABELS)).all():
        shown = ", ".join(f"{value:g}" for value in values[:6]) + (" ..." if values.size > 6 else "")
        raise InputError(
            f"{path.name}: holds the values {shown}; a label image holds 0 outside, 1 mastic, 2 aggregate, 3 void "
            "(a photograph is named specimen.png)"
        )
    return pixels.astype(np.uint8)


def image_size(path: Path) -> tuple[int, int]:
    """Rows and columns without decoding the pixels; refuses files that are truncated or no image."""

    def size(content: bytes) -> tuple[int, int]:
        return png_size(content) if content.startswith(SIGNATURE) else tiff_size(content)

    return _named(path, size)


def save_png(path: Path, image: np.ndarray) -> None:
    """Write a uint8 or uint16 image, (rows, columns) or (rows, columns, red-green-blue), as PNG."""
    image = np.asarray(image)
    if image.dtype not in (np.uint8, np.uint16) or image.ndim not in (2, 3) or image.size == 0:
        raise InputError(f"{path.name}: an image of {image.dtype} and shape {image.shape} cannot be saved as PNG")
    done, content = cv2.imencode(".png", image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    if not done:
        raise InputError(f"{path.name}: the image of shape {image.shape} could not be packed as PNG")
    write_atomically(path, content.tobytes())


def _decoded(path: Path, page: int | None) -> Raster:
    def decode(content: bytes) -> Raster:
        return read_png(content) if content.startswith(SIGNATURE) else read_tiff(content, page)

    return _named(path, decode)


def _named(path: Path, read: Callable[[bytes], T]) -> T:
    """What `read` makes of the file's bytes; its refusals get the file's name."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(
                f"{path.name}: has {path.stat().st_size / 1e9:.1f} GB, the limit is {MAX_BYTES / 1e9:.1f} GB"
            )
        content = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path.name}: does not exist in {path.parent}") from None
    except OSError as error:
        raise InputError(f"{path.name}: cannot be read ({error.strerror})") from None
    if not content:
        raise InputError(f"{path.name}: is empty (0 bytes): copy it again")
    try:
        return read(content)
    except InputError as error:
        raise InputError(f"{path.name}: {error}") from None
