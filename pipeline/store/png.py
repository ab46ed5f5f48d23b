"""PNG files: the structure is checked, then OpenCV decodes."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

import cv2
import numpy as np

from pipeline.core.errors import InputError
from pipeline.store.raster import Raster, within_limit

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY = (0, 4)  # colour types: grey, grey with alpha
_PALETTE = 3
_TRUNCATED = "is truncated: copy it again"


def png_size(content: bytes) -> tuple[int, int]:
    """Rows and columns; refuses a file that is truncated or damaged anywhere (chunk lengths and check sums)."""
    return within_limit(*_header(content)[:2])


def read_png(content: bytes) -> Raster:
    """Decode a PNG of any kind; a palette image keeps its numbers."""
    rows, columns, colour = _header(content)
    within_limit(rows, columns)
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise InputError("holds pixels that cannot be decoded: export it again")
    if pixels.ndim == 3:
        pixels = np.ascontiguousarray(pixels[:, :, 2::-1])
    if colour == _PALETTE:
        return _numbered(pixels, _palette(content))
    return Raster(pixels[:, :, 0] if colour in _GREY and pixels.ndim == 3 else pixels)


def _header(content: bytes) -> tuple[int, int, int]:
    """Rows, columns and colour type."""
    found = dict(_chunks(content))
    if b"IHDR" not in found or len(found[b"IHDR"]) != 13:
        raise InputError("has no image header: export it again")
    columns, rows, _, colour = struct.unpack(">IIBB", found[b"IHDR"][:10])
    return rows, columns, colour


def _palette(content: bytes) -> np.ndarray:
    """Colours (k, 3) of a palette image."""
    colours = dict(_chunks(content)).get(b"PLTE", b"")
    if not colours or len(colours) % 3:
        raise InputError("is a palette image without a palette: export it again")
    return np.frombuffer(colours, np.uint8).reshape(-1, 3)


def _chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Name and content of every chunk up to the end mark; refuses gaps and wrong check sums."""
    at = len(SIGNATURE)
    while True:
        if len(content) < at + 12:
            raise InputError(_TRUNCATED)
        length, name = struct.unpack(">I4s", content[at : at + 8])
        body = content[at + 8 : at + 8 + length]
        check = content[at + 8 + length : at + 12 + length]
        if len(check) < 4:
            raise InputError(_TRUNCATED)
        if zlib.crc32(body, zlib.crc32(name)) != struct.unpack(">I", check)[0]:
            raise InputError("is damaged (a check sum is wrong): copy it again")
        yield name, body
        if name == b"IEND":
            return
        at += 12 + length


def _numbered(pixels: np.ndarray, palette: np.ndarray) -> Raster:
    """Palette numbers from decoded colours; a colour that stands twice counts by its first number."""
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    weights = np.array([65536, 256, 1])
    code, seen = palette.astype(np.int64) @ weights, pixels.astype(np.int64) @ weights
    order = np.argsort(code, kind="stable")
    place = np.searchsorted(code[order], seen).clip(0, code.size - 1)
    if np.any(code[order][place] != seen):
        return Raster(pixels)
    return Raster(order[place].astype(np.uint8), palette)
