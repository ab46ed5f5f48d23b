"""images/ and frames.csv."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile

from pipeline.store.frames import frames_csv, image_files, image_problems, read_frames
from pipeline.store.images import save_png

IMAGES = tuple(Path(f"img_{i}.png") for i in range(4))


def read(tmp_path, text):
    (tmp_path / "frames.csv").write_text(text)
    return read_frames(tmp_path / "frames.csv", IMAGES)


@pytest.mark.parametrize(
    "names", [["0", "1", "2", "3"], ["1", "2", "3", "4"], ["0001", "0002", "0003", "0004"], [p.name for p in IMAGES]]
)
def test_frames_go_by_number_or_by_name(tmp_path, names):
    time, problems = read(tmp_path, "frame,time_s\n" + "".join(f"{n},{0.2 * i}\n" for i, n in enumerate(names)))
    assert problems == []
    assert np.allclose(time, [0, 0.2, 0.4, 0.6], rtol=0, atol=1e-15)  # as typed


def test_write_then_read_is_the_identity(tmp_path):
    time = np.array([0.0, 0.1, 1 / 3, 1234.5678])
    (tmp_path / "frames.csv").write_bytes(frames_csv(tuple(p.name for p in IMAGES), time))
    read_back, problems = read_frames(tmp_path / "frames.csv", IMAGES)
    assert problems == []
    assert np.allclose(read_back, time, rtol=1e-11)  # twelve digits are written


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("frame,time_s\n0,0\n1,1\n2,2\n", "has 3 rows for 4 images"),
        ("frame,time\n0,0\n1,1\n2,2\n3,3\n", "the header must be frame,time_s"),
        ("frame,time_s\n0,0\n1,1\n3,2\n2,3\n", "row 4: frame = 3, the images sorted by name have 2"),
        ("frame,time_s\nimg_0.png,0\nimg_2.png,1\nimg_1.png,2\nimg_3.png,3\n", "have img_1.png"),
        ("frame,time_s\n7,0\n8,1\n9,2\n10,3\n", "numbered from 0 or from 1"),
        ("frame,time_s\n0,0\n1,1\n2,1\n3,2\n", "row 4: time_s = 1 must be larger than 1"),
        ("frame,time_s\n0,0\n1,nan\n2,2\n3,3\n", "row 3: time_s = 'nan' is not a finite number"),
        ("frame,time_s\n0,0\n1,\n2,2\n3,3\n", "row 3: time_s = '' is not a finite number"),
        ("", "the header must be"),
    ],
)
def test_a_refusal_names_row_and_rule(tmp_path, text, sentence):
    time, problems = read(tmp_path, text)
    assert time is None
    assert any(p.startswith("frames.csv: ") and sentence in p for p in problems)


def test_images_are_sorted_by_name_and_others_ignored(tmp_path):
    for name in ("b.png", "a.TIF", "c.tiff", "notes.txt", "._b.png", "Thumbs.db"):
        (tmp_path / name).write_bytes(b"x")
    assert [p.name for p in image_files(tmp_path)] == ["a.TIF", "b.png", "c.tiff"]


def test_images_of_another_size_and_unreadable_ones_are_named(tmp_path):
    for i, size in enumerate([(20, 30), (20, 30), (20, 31)]):
        save_png(tmp_path / f"{i}.png", np.zeros(size, np.uint8))
    (tmp_path / "3.png").write_bytes((tmp_path / "0.png").read_bytes()[:-20])
    problems = image_problems(image_files(tmp_path), thorough=False)
    assert problems == [
        "images/3.png: is truncated: copy it again",
        "images/2.png: has 31 × 20 pixels, the first image 30 × 20: all must be alike",
    ]


def test_blank_images_are_named_when_every_pixel_is_looked_at(tmp_path):
    speckle = np.random.default_rng(0).integers(0, 256, (20, 30), dtype=np.uint8)
    for i, image in enumerate([speckle, np.full((20, 30), 255, np.uint8), np.zeros((20, 30), np.uint8)]):
        save_png(tmp_path / f"{i}.png", image)
    assert image_problems(image_files(tmp_path), thorough=False) == []
    assert image_problems(image_files(tmp_path), thorough=True) == [
        "images/1.png: is blank (every pixel has the grey value 255): leave it out, with its time",
        "images/2.png: is blank (every pixel has the grey value 0): leave it out, with its time",
    ]


def test_images_of_many_kinds_may_stand_side_by_side(tmp_path):
    speckle = np.random.default_rng(0).integers(0, 256, (20, 30), dtype=np.uint8)
    save_png(tmp_path / "0.png", speckle)
    save_png(tmp_path / "1.png", speckle.astype(np.uint16) * 16)
    save_png(tmp_path / "2.png", np.dstack([speckle] * 3))
    tifffile.imwrite(tmp_path / "3.tif", speckle.astype(np.float32))
    assert image_problems(image_files(tmp_path), thorough=True) == []
    tifffile.imwrite(tmp_path / "4.tif", np.stack([speckle] * 2))
    problems = image_problems(image_files(tmp_path), thorough=False)
    assert problems == ["images/4.tif: has 2 pages, one is needed: save the page that is meant as a file of its own"]
