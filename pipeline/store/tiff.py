"""TIFF files, read by tifffile; by OpenCV where their packing asks for it."""

from __future__ import annotations

import io
import logging

import cv2
import numpy as np
import tifffile

from pipeline.core.errors import InputError
from pipeline.store.raster import Raster, within_limit

_GREYS = {tifffile.PHOTOMETRIC.MINISWHITE, tifffile.PHOTOMETRIC.MINISBLACK, tifffile.PHOTOMETRIC.PALETTE}
_COLOURS = {tifffile.PHOTOMETRIC.RGB, tifffile.PHOTOMETRIC.YCBCR}
_UNPACKED = (8, 10, 12, 14, 16, 32)  # bits a value that OpenCV decodes

# what they would complain of is said by our errors
logging.getLogger("tifffile").setLevel(logging.CRITICAL)
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def tiff_size(content: bytes, page: int | None = None) -> tuple[int, int]:
    """Rows and columns; refuses a file that is truncated or has several pages."""
    with _opened(content) as file:
        chosen = _page(file, page, len(content))
        return within_limit(chosen.imagelength, chosen.imagewidth)


def read_tiff(content: bytes, page: int | None = None) -> Raster:
    """Decode one page, counted from 0; without a number the file must have one page only.

    Reduced copies (pyramids, thumbnails) do not count as pages.
    """
    with _opened(content) as file:
        chosen = _page(file, page, len(content))
        within_limit(chosen.imagelength, chosen.imagewidth)
        _check_kind(chosen)
        try:
            return _raster(chosen.asarray(), chosen)
        except InputError:
            raise
        except Exception as error:  # tifffile lets errors of every kind through
            return _by_opencv(content, chosen, str(error))


def _opened(content: bytes) -> tifffile.TiffFile:
    try:
        return tifffile.TiffFile(io.BytesIO(content))
    except Exception as error:
        raise InputError(f"is neither PNG nor TIFF ({error}): export it as one of them") from None


def _check_kind(page: tifffile.TiffPage) -> None:
    """Refuse pixels that are neither grey values, palette numbers nor colours of red, green and blue."""
    kind = np.dtype(page.dtype).kind if page.dtype is not None else "?"
    most = 4 if page.photometric in _COLOURS else 2  # alpha included
    if page.photometric not in _COLOURS | _GREYS or page.samplesperpixel > most or kind not in "buif":
        name = getattr(page.photometric, "name", page.photometric)
        raise InputError(
            f"holds {page.samplesperpixel} values of type {page.dtype} a pixel ({name}): one grey value is needed, or "
            "red, green and blue"
        )


def _page(file: tifffile.TiffFile, page: int | None, size: int) -> tifffile.TiffPage:
    """The page asked for, all of whose pixels lie inside the file of `size` bytes."""
    try:
        pages = [p for p in map(_full, file.pages) if not p.is_reduced]
    except Exception:
        pages = []
    if not pages:
        raise InputError("is truncated (no page can be found): copy it again")
    if page is None and len(pages) > 1:
        raise InputError(f"has {len(pages)} pages, one is needed: save the page that is meant as a file of its own")
    if not 0 <= (page or 0) < len(pages):
        raise InputError(f"has no page {page}: they are counted 0 to {len(pages) - 1}")
    chosen = pages[page or 0]
    ends = [a + n for a, n in zip(chosen.dataoffsets, chosen.databytecounts, strict=False)]
    if not ends or max(ends) > size:
        raise InputError("is truncated (pixels lie beyond its end): copy it again")
    return chosen


def _full(page: tifffile.TiffPage | tifffile.TiffFrame) -> tifffile.TiffPage:
    """A page with all its tags."""
    return page.aspage()


def _raster(pixels: np.ndarray, page: tifffile.TiffPage) -> Raster:
    """Rows, columns and colours in this order; white is large."""
    if pixels.dtype == bool:
        pixels = pixels.astype(np.uint8) * np.uint8(255)
    if page.planarconfig == 2 and pixels.ndim == 3:
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.ndim == 3 and pixels.shape[2] == 2:
        pixels = pixels[:, :, 0]  # grey with alpha
    if pixels.shape[:2] != (page.imagelength, page.imagewidth) or pixels.ndim > 3:
        raise InputError(f"has pixels of shape {pixels.shape}: one flat image is needed")
    if page.photometric == tifffile.PHOTOMETRIC.MINISWHITE and pixels.dtype.kind == "u":
        pixels = np.iinfo(pixels.dtype).max - pixels
    if page.photometric == tifffile.PHOTOMETRIC.PALETTE and page.colormap is not None:
        return Raster(pixels, np.moveaxis(np.asarray(page.colormap), 0, -1))
    return Raster(pixels)


def _by_opencv(content: bytes, page: tifffile.TiffPage, reason: str) -> Raster:
    """Decode packings that tifffile leaves to a further library (LZW, PackBits, JPEG; 10, 12 and 14 bits)."""
    plain = page.photometric in _COLOURS | {tifffile.PHOTOMETRIC.MINISBLACK} and page.bitspersample in _UNPACKED
    done, pages = cv2.imdecodemulti(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED) if plain else (False, ())
    if not done or page.index >= len(pages):
        raise InputError(
            f"holds pixels of {page.bitspersample} bits that cannot be decoded ({reason}): save it with 8 or 16 bits, "
            "without compression"
        )
    pixels = np.asarray(pages[page.index])
    if page.bitspersample in (10, 12, 14):  # OpenCV fills 16 bits from the top
        pixels = np.right_shift(pixels, 16 - page.bitspersample)
    return Raster(pixels if pixels.ndim == 2 else np.ascontiguousarray(pixels[:, :, 2::-1]))
