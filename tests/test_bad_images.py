"""Speckle images and settings of them that are refused, by the commands."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.bundles import edit
from helpers.commands import run
from helpers.refusals import FAULT

SPOILT = {
    "no image": (lambda b: [p.unlink() for p in (b / "images").iterdir()], "images/: holds no PNG or TIFF image"),
    "no images": (lambda b: (shutil.rmtree(b / "images"), (b / "frames.csv").unlink()), "holds no speckle images"),
    "one missing": (lambda b: (b / "images" / "frame_0007.png").unlink(), "has 29 rows for 28 images"),
    "another size": (
        lambda b: cv2.imwrite(str(b / "images" / "frame_0005.png"), np.eye(90, dtype=np.uint8) * 200),
        "frame_0005.png: has 90 × 90 pixels, the first image",
    ),
    "blank": (lambda b: repaint(b / "images" / "frame_0004.png", lambda p: 0 * p + 77), "frame_0004.png: "),
    "other speckle": (
        lambda b: repaint(b / "images" / "frame_0003.png", lambda p: np.ascontiguousarray(p[::-1, ::-1])),
        "frame_0003.png: ",
    ),
    "cut short": (
        lambda b: (b / "images" / "frame_0002.png").write_bytes((b / "images" / "frame_0002.png").read_bytes()[:999]),
        "frame_0002.png",
    ),
    "no scale": (lambda b: edit(b, mm_per_px="nan"), "mm_per_px"),
    "no camera": (lambda b: drop_camera(b), "[camera] is missing"),
    "another clock": (lambda b: shift(b / "frames.csv", 9000.0), "do not overlap those of load_cmod.csv"),
    "backwards": (lambda b: shift(b / "frames.csv", 0.0, turn=-1.0), "must be larger than"),
}


def repaint(path: Path, how) -> None:
    """Change the pixels of an image."""
    cv2.imwrite(str(path), how(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)))


def drop_camera(bundle: Path) -> None:
    """Take [camera] out of the settings."""
    path = bundle / "experiment.toml"
    path.write_text(re.sub(r"(?ms)^\[camera\].*?(?=^\[)", "", path.read_text("utf-8")), "utf-8")


def shift(path: Path, by: float, turn: float = 1.0) -> None:
    """Move the times of frames.csv."""
    head, *rows = path.read_text("utf-8").splitlines()
    moved = [f"{name},{turn * float(time) + by:.6f}" for name, time in (row.split(",") for row in rows)]
    path.write_text("\n".join([head, *moved]) + "\n", "utf-8")


@pytest.mark.parametrize("how", SPOILT)
def test_bad_images_are_one_clear_message(film, tmp_path, how):
    bundle = shutil.copytree(film, tmp_path / "film")
    spoil, told = SPOILT[how]
    spoil(bundle)
    done = run("dic", bundle, "-o", tmp_path / "out", "--workers", "1")
    assert (done.exit_code, done.stdout) == (1, "")
    assert told in done.stderr
    assert done.stderr.count("cohesive-bpm: ") == 1
    assert FAULT not in done.stderr


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (("--objective", "load", "--levelling"), "objective = load compares none"),
        (("--grid", "0.9,1,1.1", "--levelling", "--objective", "fields"), "[camera]"),
    ],
)
def test_levelling_is_obeyed_or_refused(film, tmp_path, line, told):
    bundle = shutil.copytree(film, tmp_path / "film")
    drop_camera(bundle)
    fields = ("--fields", film / "truth.h5")
    done = run("identify", bundle, "-o", tmp_path / "out", "--engine", "equilibrium", *fields, *line)
    assert done.exit_code == 1
    assert told in done.stderr
    config = tmp_path / "run.toml"
    config.write_text("levelling = true\n")
    line = tuple(word for word in line if word != "--levelling")
    again = run(
        "identify", bundle, "-o", tmp_path / "out", "--engine", "equilibrium", *fields, *line, "--config", config
    )
    assert again.stderr == done.stderr


@pytest.mark.parametrize("option", [("--subset", "24"), ("--subset", "3"), ("--step", "0"), ("--workers", "0")])
def test_impossible_settings_are_wrong_usage(film, tmp_path, option):
    assert run("dic", film, "-o", tmp_path / "out", *option).exit_code == 2


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (("--images", "--noise-px", "0.02"), "--noise-px belongs to displacement fields"),
        (("--noise-grey", "3"), "--noise-grey belongs to speckle images: add --images"),
        (("--camera-mm-per-px", "0.1"), "--camera-mm-per-px belongs to speckle images"),
    ],
)
def test_noise_of_the_other_kind_is_refused(tmp_path, line, told):
    done = run("virtual-test", tmp_path / "made", *line)
    assert done.exit_code == 1
    assert told in done.stderr
    assert not (tmp_path / "made").exists()


def test_a_region_beyond_the_picture_is_refused(film, tmp_path):
    bundle = shutil.copytree(film, tmp_path / "film")
    edit(bundle, roi_px="[0, 0, 5000, 100]")
    done = run("dic", bundle, "-o", tmp_path / "out")
    assert done.exit_code == 1
    assert "reaches outside the picture" in done.stderr
