"""Image files of every kind, whole and spoilt."""

from __future__ import annotations

import struct
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.core.errors import InputError, MissingFileError
from pipeline.store.images import image_size, read_grey, read_labels, save_png
from pipeline.store.raster import MAX_BYTES, MAX_PIXELS

GREY = np.random.default_rng(0).integers(0, 256, (40, 60), dtype=np.uint8)
COLOUR = np.random.default_rng(1).integers(0, 256, (40, 60, 3), dtype=np.uint8)


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def palette_png(numbers: np.ndarray, palette: np.ndarray) -> bytes:
    """A palette PNG after the standard: one byte a pixel, no filter."""
    rows = b"".join(b"\0" + row.tobytes() for row in numbers.astype(np.uint8))
    head = struct.pack(">IIBBBBB", numbers.shape[1], numbers.shape[0], 8, 3, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"PLTE", palette.astype(np.uint8).tobytes())
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


@settings(max_examples=40)
@given(
    st.sampled_from([np.uint8, np.uint16]).flatmap(
        lambda kind: arrays(kind, st.tuples(st.integers(1, 12), st.integers(1, 12)))
    )
)
def test_save_then_read_is_the_identity(tmp_path_factory, image):
    path = tmp_path_factory.mktemp("png") / "x.png"
    save_png(path, image)
    assert image_size(path) == image.shape
    assert np.array_equal(read_grey(path), image)


@pytest.mark.parametrize("compression", [None, "zlib"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_grey_tiff_of_any_depth_is_read_as_it_is(tmp_path, compression, kind):
    tifffile.imwrite(tmp_path / "x.tif", GREY.astype(kind) * kind(7), compression=compression)
    assert np.array_equal(read_grey(tmp_path / "x.tif"), (GREY.astype(kind) * kind(7)).astype(np.float32))
    assert image_size(tmp_path / "x.tif") == GREY.shape


@pytest.mark.parametrize("packing", [5, 32773])  # LZW, PackBits: left to OpenCV
def test_other_packings_are_read_too(tmp_path, packing):
    cv2.imwrite(str(tmp_path / "x.tif"), GREY, [cv2.IMWRITE_TIFF_COMPRESSION, packing])
    assert np.array_equal(read_grey(tmp_path / "x.tif"), GREY)


def test_twelve_bits_in_sixteen_keep_their_levels(tmp_path):
    save_png(tmp_path / "x.png", GREY.astype(np.uint16) * 16)
    assert read_grey(tmp_path / "x.png").max() == 16 * int(GREY.max())


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_colours_become_luminance(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    tifffile.imwrite(path, COLOUR) if suffix == ".tif" else save_png(path, COLOUR)
    expected = COLOUR @ np.array([0.299, 0.587, 0.114])
    assert np.allclose(read_grey(path), expected, rtol=0, atol=1e-4)  # single precision of 255


def test_planar_colours_and_alpha_are_understood(tmp_path):
    tifffile.imwrite(tmp_path / "x.tif", np.moveaxis(COLOUR, -1, 0), photometric="rgb", planarconfig="separate")
    tifffile.imwrite(tmp_path / "y.tif", COLOUR)
    grey = read_grey(tmp_path / "y.tif")
    assert np.allclose(read_grey(tmp_path / "x.tif"), grey, rtol=0, atol=1e-4)  # single precision of 255
    with_alpha = np.dstack([COLOUR, np.full(GREY.shape, 40, np.uint8)])
    cv2.imwrite(str(tmp_path / "z.png"), with_alpha[:, :, [2, 1, 0, 3]])
    assert np.allclose(read_grey(tmp_path / "z.png"), grey, rtol=0, atol=1e-4)  # the same


def test_white_may_be_zero(tmp_path):
    tifffile.imwrite(tmp_path / "x.tif", 255 - GREY, photometric="miniswhite")
    assert np.array_equal(read_grey(tmp_path / "x.tif"), GREY)


def test_a_palette_gives_colours_to_photographs_and_numbers_to_labels(tmp_path):
    numbers = np.random.default_rng(2).integers(0, 4, (9, 7))
    palette = np.array([[0, 0, 0], [200, 30, 30], [30, 200, 30], [30, 30, 200]])
    (tmp_path / "x.png").write_bytes(palette_png(numbers, palette))
    assert np.array_equal(read_labels(tmp_path / "x.png"), numbers)
    expected = palette[numbers] @ np.array([0.299, 0.587, 0.114])
    assert np.allclose(read_grey(tmp_path / "x.png"), expected, rtol=0, atol=1e-4)  # single precision of 255


def test_labels_are_read_and_other_values_refused(tmp_path):
    labels = np.array([[0, 1], [2, 3]], np.uint8)
    save_png(tmp_path / "labels.png", labels)
    assert np.array_equal(read_labels(tmp_path / "labels.png"), labels)
    save_png(tmp_path / "labels.png", labels * 85)
    with pytest.raises(InputError, match=r"labels\.png: holds the values 0, 85, 170, 255; a label image holds"):
        read_labels(tmp_path / "labels.png")
    save_png(tmp_path / "labels.png", COLOUR)
    with pytest.raises(InputError, match="is a colour image"):
        read_labels(tmp_path / "labels.png")


def test_several_pages_are_refused_unless_one_is_chosen(tmp_path):
    stack = np.random.default_rng(3).integers(0, 2**16, (5, 8, 9), dtype=np.uint16)
    tifffile.imwrite(tmp_path / "x.tif", stack)
    with pytest.raises(InputError, match=r"x\.tif: has 5 pages, one is needed"):
        read_grey(tmp_path / "x.tif")
    assert np.array_equal(read_grey(tmp_path / "x.tif", page=3), stack[3])
    with pytest.raises(InputError, match="counted 0 to 4"):
        read_grey(tmp_path / "x.tif", page=5)


def test_a_slice_of_the_measured_tomogram_is_read(shared_data):
    slice_ = read_grey(shared_data / "concrete_ct_spam" / "concrete_x-ray-bin16.tif", page=50)
    assert slice_.shape == (100, 100)
    assert slice_.std() > 0


@pytest.mark.parametrize("read", [read_grey, read_labels, image_size])
@pytest.mark.parametrize("tenth", range(10))
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_truncated_file_is_named(tmp_path, read, tenth, suffix):
    path = tmp_path / f"specimen{suffix}"
    tifffile.imwrite(path, GREY % 4, compression="zlib") if suffix == ".tif" else save_png(path, GREY % 4)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * tenth // 10])
    with pytest.raises(InputError, match=rf"^specimen{suffix}: "):
        read(path)


@settings(max_examples=60)
@given(st.data())
def test_a_png_with_a_changed_bit_is_seen(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("bits") / "x.png"
    save_png(path, GREY)
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content)
    for read in (read_grey, image_size):
        with pytest.raises(InputError, match=r"^x\.png: "):
            read(path)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89PNG\r\n\x1a\n", b"II*\0\x08\0\0\0", b"\xff\xd8\xff\xe0JFIF"])
def test_what_is_no_image_gets_one_clear_error(tmp_path, content):
    (tmp_path / "specimen.png").write_bytes(content)
    with pytest.raises(InputError, match=r"^specimen\.png: "):
        read_grey(tmp_path / "specimen.png")


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(MissingFileError, match=r"a\.png: does not exist"):
        read_grey(tmp_path / "a.png")
    (tmp_path / "b.png").mkdir()
    with pytest.raises(InputError, match=r"b\.png: cannot be read"):
        read_grey(tmp_path / "b.png")


def tiff_header(columns: int, rows: int, bits: int, data: bytes, **tags: int) -> bytes:
    """A TIFF of one strip of grey values after the standard (revision 6.0)."""
    entries = {256: columns, 257: rows, 258: bits, 259: 1, 262: 1, 273: 8 + 2 + 9 * 12 + 4, 277: 1, 278: rows}
    entries |= {279: len(data)} | {int(k[1:]): v for k, v in tags.items()}
    rows_of = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in sorted(entries.items()))
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + rows_of + bytes(4) + data


def plain_png(columns: int, rows: int, depth: int, colour: int, pixels: bytes) -> bytes:
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, depth, colour, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(pixels)) + chunk(b"IEND", b"")


@pytest.mark.parametrize("kind", ["png", "tif"])
@pytest.mark.parametrize(("columns", "rows"), [(50_000, 50_000), (0, 5), (2**31 - 1, 2**31 - 1)])
def test_an_image_too_large_or_without_pixels_is_refused_before_it_is_decoded(tmp_path, columns, rows, kind):
    path = tmp_path / f"x.{kind}"
    make = plain_png if kind == "png" else tiff_header
    path.write_bytes(make(columns, rows, 8, *((0,) if kind == "png" else ()), bytes(100)))
    tracemalloc.start()
    for read in (read_grey, image_size):
        with pytest.raises(InputError, match=f"{columns} × {rows} pixels"):
            read(path)
    assert tracemalloc.get_traced_memory()[1] < 10e6  # bytes: nothing of the image's size is made
    tracemalloc.stop()
    assert MAX_PIXELS < 50_000**2


def test_a_file_too_large_is_not_read(tmp_path):
    with (tmp_path / "x.tif").open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(InputError, match=r"^x\.tif: has 2\.4 GB, the limit is 2\.4 GB"):
        read_grey(tmp_path / "x.tif")


def test_twelve_bits_packed_tightly_are_read(tmp_path):
    levels = np.random.default_rng(4).integers(0, 4096, (40, 60))
    one, two = levels[:, ::2], levels[:, 1::2]
    packed = np.stack([one >> 4, (one & 15) << 4 | two >> 8, two & 255], axis=-1).astype(np.uint8)
    (tmp_path / "x.tif").write_bytes(tiff_header(60, 40, 12, packed.tobytes()))
    assert np.array_equal(read_grey(tmp_path / "x.tif"), levels)


def test_a_grey_palette_tiff_gives_its_greys(tmp_path):
    ramp = np.stack([np.arange(255, -1, -1) * 257] * 3).astype(np.uint16)
    tifffile.imwrite(tmp_path / "x.tif", GREY, photometric="palette", colormap=ramp)
    assert np.allclose(read_grey(tmp_path / "x.tif"), (255.0 - GREY) * 257, rtol=1e-6)  # single precision
    assert np.array_equal(read_labels_of(tmp_path, GREY % 4, ramp), GREY % 4)


def read_labels_of(folder, labels, ramp):
    tifffile.imwrite(folder / "labels.tif", labels, photometric="palette", colormap=ramp)
    return read_labels(folder / "labels.tif")


@pytest.mark.parametrize(
    ("pixels", "options"),
    [
        (np.dstack([COLOUR, GREY]), {"photometric": "separated"}),
        (np.dstack([COLOUR, GREY, GREY]), {"photometric": "minisblack", "planarconfig": "contig"}),
        (GREY.astype(np.complex64), {}),
    ],
    ids=["cyan, magenta, yellow, black", "five values", "complex"],
)
def test_pixels_that_are_neither_grey_nor_colours_are_refused(tmp_path, pixels, options):
    tifffile.imwrite(tmp_path / "x.tif", pixels, **options)
    with pytest.raises(InputError, match=r"^x\.tif: holds \d values of type \w+ a pixel .* one grey value is needed"):
        read_grey(tmp_path / "x.tif")


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (plain_png(60, 40, 8, 0, bytes(61 * 40 - 1)), r"its pixels do not fill 60 × 40 px"),
        (plain_png(60, 40, 8, 0, bytes(10**8)), r"its pixels do not fill 60 × 40 px"),
        (plain_png(60, 40, 5, 0, bytes(61 * 40)), r"colour type 0 with 5 bits does not exist"),
        (plain_png(60, 40, 8, 7, bytes(61 * 40)), r"colour type 7 with 8 bits does not exist"),
        (tiff_header(60, 40, 4, bytes(30 * 40)), r"holds pixels of 4 bits that cannot be decoded"),
    ],
)
def test_what_no_camera_writes_is_refused_and_nothing_else_is_said(tmp_path, capfd, content, sentence):
    (tmp_path / "x").write_bytes(content)
    with pytest.raises(InputError, match=sentence):
        read_grey(tmp_path / "x")
    assert capfd.readouterr() == ("", "")  # the decoders below keep quiet


def test_interlaced_and_narrow_pngs_are_whole(tmp_path):
    for depth, width in ((1, 13), (2, 5), (4, 7)):
        row = b"\0" + bytes([0b10110001] * ((width * depth + 7) // 8))
        (tmp_path / "x.png").write_bytes(plain_png(width, 3, depth, 0, row * 3))
        assert read_grey(tmp_path / "x.png").shape == (3, width)
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 3, 3, 8, 0, 0, 0, 1))  # passes 1, 4, 5, 6 and 7 hold 1, 1, 2, 2 and 3
    rows = b"\0\x09" + b"\0\x07" + b"\0\x05\x06" + b"\0\x08" * 2 + b"\0\x01\x02\x03"
    body = chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    (tmp_path / "y.png").write_bytes(b"\x89PNG\r\n\x1a\n" + head + body)
    assert read_grey(tmp_path / "y.png").tolist() == [[9, 8, 7], [1, 2, 3], [5, 8, 6]]


def test_nan_grey_levels_are_refused(tmp_path):
    tifffile.imwrite(tmp_path / "x.tif", np.full((3, 3), np.nan, np.float32))
    with pytest.raises(InputError, match="NaN"):
        read_grey(tmp_path / "x.tif")


@pytest.mark.parametrize("image", [np.zeros((2, 2)), np.zeros((0, 3), np.uint8), np.zeros(4, np.uint8)])
def test_what_cannot_be_a_png_is_not_written(tmp_path, image):
    with pytest.raises(InputError, match=r"x\.png"):
        save_png(tmp_path / "x.png", image)
    assert list(tmp_path.iterdir()) == []
