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
_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # values a pixel, by colour type
_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}  # ISO/IEC 15948, table 11.1
_PASSES = {  # first column and row, and step of each pass, by interlace method
    0: ((0, 0, 1, 1),),
    1: ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)),
}
_PIECE = 2**16  # bytes that are unpacked at a time
_TRUNCATED = "is truncated: copy it again"
_DAMAGED = "is damaged"


def png_size(content: bytes) -> tuple[int, int]:
    """Rows and columns; refuses a file that is truncated or damaged anywhere (chunk lengths and check sums)."""
    return within_limit(*_header(content)[:2])


def read_png(content: bytes) -> Raster:
    """Decode a PNG of any kind; a palette image keeps its numbers."""
    rows, columns, colour = _header(content)
    within_limit(rows, columns)
    _check_pixels(content)
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
    columns, rows, depth, colour, *_, interlace = struct.unpack(">IIBBBBB", _head(content))
    if depth not in _DEPTHS.get(colour, ()) or interlace not in _PASSES:
        raise InputError(f"{_DAMAGED} (colour type {colour} with {depth} bits does not exist): export it again")
    return rows, columns, colour


def _head(content: bytes) -> bytes:
    found = dict(_chunks(content))
    if b"IHDR" not in found or len(found[b"IHDR"]) != 13:
        raise InputError("has no image header: export it again")
    return found[b"IHDR"]


def _check_pixels(content: bytes) -> None:
    """Refuse a file whose pixels are fewer or more than its header promises; nothing is held in memory."""
    columns, rows, depth, colour, *_, interlace = struct.unpack(">IIBBBBB", _head(content))
    bits, wanted = depth * _SAMPLES[colour], 0
    for column, row, right, down in _PASSES[interlace]:
        wide, high = max(0, -((column - columns) // right)), max(0, -((row - rows) // down))
        wanted += high * (1 + (wide * bits + 7) // 8) if wide else 0
    if _inflated(b"".join(body for name, body in _chunks(content) if name == b"IDAT"), wanted) != wanted:
        raise InputError(f"{_DAMAGED} (its pixels do not fill {columns} × {rows} px): copy or export it again")


def _inflated(packed: bytes, limit: int) -> int:
    """How many bytes were packed; a little above `limit` where there are more, −1 where they cannot be unpacked."""
    inflate, total = zlib.decompressobj(), 0
    try:
        for at in range(0, len(packed), _PIECE):
            piece = packed[at : at + _PIECE]
            while piece and total <= limit:
                total += len(inflate.decompress(piece, 16 * _PIECE))
                piece = inflate.unconsumed_tail
        return total if total > limit else total + len(inflate.flush())
    except zlib.error:
        return -1


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
