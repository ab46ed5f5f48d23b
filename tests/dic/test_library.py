"""The border to the compiled library: refusals, ownership, threads, a library that is missing or does not fit."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.core.errors import InputError, ToolchainError
from pipeline.dic import library
from pipeline.dic.core import core
from pipeline.dic.interface import Pattern, Picture, cover, match, propagate, split
from pipeline.dic.settings import Settings

HEADER = Path(pipeline.__file__).parent / "dic" / "cpp" / "interface.h"
GREY = np.random.default_rng(0).normal(100, 20, (60, 80)).astype(np.float32)
POINTS = np.array([[30.0, 30.0], [40.0, 30.0]])
ONE = Settings(subset_size_px=15, threads=1).solver() | {"accept": 0.7}


@pytest.fixture(scope="module")
def picture() -> Picture:
    return Picture(GREY)


def declared(record: str) -> list[tuple[str, int]]:
    """Names and lengths of the fields of a record in the header, in order."""
    body = next(
        b for b, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", HEADER.read_text(), re.S) if name == record
    )
    fields = re.findall(r"(?:double|int32_t) ([^;]*);", body)
    names = [part.strip() for field in fields for part in field.split(",")]
    return [(n.split("[")[0], int(n.split("[")[1][:-1]) if "[" in n else 1) for n in names]


@pytest.mark.parametrize(("record", "dtype"), [("dic_matched", library.MATCHED), ("dic_parted", library.PARTED)])
def test_records_are_those_of_the_header(record, dtype):
    assert declared(record) == [(n, int(np.prod(dtype[n].shape))) for n in dtype.names]
    assert [n for n, _ in declared("dic_settings")] == [n for n, _ in library.SettingsStruct._fields_]


def test_numbers_are_those_of_the_header():
    numbers = dict(re.findall(r"#define (DIC_\w+) (\d+)", HEADER.read_text()))
    assert int(numbers["DIC_INTERFACE"]) == library.VERSION == core().library().dic_interface()
    functions = set(re.findall(r"DIC_API \w+ (dic_\w+)\(", HEADER.read_text()))
    assert functions == {*library._CHECKED, *library._FREEING, "dic_interface"}


def test_a_picture_matches_itself_to_the_last_digit(picture):
    found = match(picture, picture, POINTS, np.zeros((2, 6)), **ONE)
    assert found["outcome"].tolist() == [0, 0]
    assert np.allclose(found["warp"], 0, rtol=0, atol=1e-6)  # the spline in single precision
    assert set(found) == set(library.MATCHED.names)


@pytest.mark.parametrize(
    ("work", "sentence"),
    [
        (lambda p: Picture(GREY[:7]), "a picture needs 8 rows and 8 columns"),
        (lambda p: Picture(GREY[0]), "a picture has rows and columns"),
        (lambda p: Pattern(np.ones((3, 5))), r"a blob has 4 numbers: column, row, sigma, grey, got .* \(3, 5\)"),
        (lambda p: Pattern([[0, 0, 1, np.nan]]), "a blob needs finite numbers and a positive sigma"),
        (lambda p: Pattern([[0, 0, 0, 1]]), "a positive sigma"),
        (lambda p: Pattern([[0, 0, 1, 1], [1e9, 1e9, 1, 1]]), "too far apart"),
        (lambda p: Pattern([[0, 0, 1, 1]]).evaluate(np.ones(4)), "a point has 2 numbers"),
        (lambda p: match(p, p, np.ones((2, 3)), np.zeros((2, 6)), **ONE), "a point has 2 numbers"),
        (lambda p: match(p, p, POINTS, np.zeros((3, 6)), **ONE), "one warp guesses a point"),
        (lambda p: match(p, p, POINTS, np.zeros((2, 6)), np.zeros((1, 6)), **ONE), "one warp carries a point"),
        (lambda p: match(p, p, POINTS, np.zeros((2, 6)), **ONE | {"half": 1}), "2 to 200 px"),
        (lambda p: match(p, p, POINTS, np.zeros((2, 6)), **ONE | {"half": 201}), "2 to 200 px"),
        (lambda p: match(p, p, POINTS, np.zeros((2, 6)), **ONE | {"model": 3}), r"2 \(affine\)"),
        (lambda p: spread(p, neighbours=np.zeros((2, 7), int)), "neighbours are points × 8"),
        (lambda p: spread(p, neighbours=np.full((2, 8), 2)), "a missing neighbour"),
        (lambda p: spread(p, neighbours=np.full((2, 8), -2)), "a missing neighbour"),
        (lambda p: spread(p, seeds=[2]), "a missing point"),
        (lambda p: spread(p, seeds=[0, 1]), "one warp guesses a seed"),
        (lambda p: cut(p, candidates=np.zeros((2, 9))), "rows of 10 numbers"),
        (lambda p: cut(p, first=[0, 1]), "2 points need 3 starts of candidates, got 2"),
        (lambda p: cut(p, first=[0, 1, 3]), "must lie among them"),
        (lambda p: cut(p, first=[-1, 1, 2]), "must lie among them"),
        (lambda p: cut(p, first=[0, 2, 1]), "must not decrease"),
        (lambda p: cut(p, candidates=np.zeros((16, 10)), first=[0, 16, 16]), "at most 15 candidates"),
        (lambda p: cut(p, lines=np.zeros((2, 3))), "a line has an angle and an offset"),
        (lambda p: raster(triangles=[[0, 1, 3]]), "a missing corner"),
        (lambda p: raster(triangles=[[0, 1]]), "a triangle has 3 corners"),
        (lambda p: raster(corners=np.zeros((3, 3))), "a corner has 2 numbers"),
        (lambda p: raster(columns=0), "a raster has columns, rows and a positive step"),
        (lambda p: raster(rows=-1), "a raster has columns, rows and a positive step"),
        (lambda p: raster(step=0.0), "a raster has columns, rows and a positive step"),
    ],
)
def test_what_breaks_a_rule_is_refused_with_the_rule(picture, work, sentence):
    with pytest.raises(InputError, match=sentence):
        work(picture)


def spread(picture, neighbours=((-1,) * 8,) * 2, seeds=(0,)):
    return propagate(picture, picture, POINTS, np.array(neighbours), np.array(seeds), np.zeros((1, 6)), **ONE)


def cut(picture, candidates=((0.0,) * 10,) * 2, first=(0, 1, 2), lines=None):
    return split(picture, picture, POINTS, np.array(candidates), np.array(first), 1.0, None, None, lines, **ONE)


def raster(corners=((0.0, 0.0),) * 3, triangles=((0, 1, 2),), step=1.0, columns=3, rows=3):
    return cover(np.array(corners), np.array(triangles), column0=0.0, row0=0.0, step=step, columns=columns, rows=rows)


def test_one_thing_is_not_taken_for_another(picture):
    with pytest.raises(Exception, match=r"expected .*PictureStruct"):
        match(picture, Pattern([[0, 0, 1, 1]]), POINTS, np.zeros((2, 6)), **ONE)


def test_positions_that_are_no_numbers_fail_as_points_do(picture):
    points = np.array([[np.nan, 30.0], [1e300, -1e300]])
    found = match(picture, picture, points, np.full((2, 6), np.nan), **ONE)
    assert found["outcome"].tolist() == [2, 2]  # outside


def test_what_the_library_holds_goes_with_its_owner():
    import resource

    large = np.random.default_rng(0).normal(size=(600, 600))
    before = 0
    for turn in range(40):
        Picture(large)
        if turn == 4:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000  # kB: 35 pictures of 5.8 MB are 200 MB


def test_threads_share_pictures_and_the_interpreter(picture):
    points = np.column_stack([a.ravel() for a in np.meshgrid(np.arange(12.0, 68), np.arange(12.0, 48))])
    alone = match(picture, picture, points, np.zeros((len(points), 6)), **ONE)
    found: dict[int, dict[str, np.ndarray]] = {}

    def work(k: int) -> None:
        found[k] = match(picture, picture, points, np.zeros((len(points), 6)), **ONE)

    crew = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in crew:
        thread.start()
    for thread in crew:
        thread.join()
    assert all(np.array_equal(one[name], alone[name]) for one in found.values() for name in alone)


def test_the_interpreter_goes_on_while_the_library_works():
    pattern = Pattern(np.random.default_rng(0).uniform([0, 0, 5, 1], [40, 40, 9, 2], (2000, 4)))
    done = threading.Event()
    ticks = []

    def work() -> None:
        pattern.evaluate(np.full((40_000, 2), 20.0))
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.wait(0.002):
        ticks.append(1)
    thread.join()
    assert len(ticks) > 5  # it works for 0.3 s and more; with the interpreter held there would be one tick


def test_memory_that_is_not_there_is_a_memory_error():
    program = (
        "import numpy as np, resource\n"
        "from pipeline.dic.interface import Pattern\n"
        "Pattern([[0, 0, 1, 1]])\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))\n"
        "try:\n    Pattern([[0, 0, 1, 1], [2e5, 2e5, 1, 1]])\n"
        "except MemoryError as error:\n    print(error)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=HEADER.parents[3]
    )
    assert run.stdout.strip() == "the image correlation needs more memory than there is"


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder in which the library is looked for, and what looking gives."""
    monkeypatch.setattr(library, "__file__", str(tmp_path / "library.py"))
    library.library.cache_clear()
    yield tmp_path / "libcorrelate.so"
    library.library.cache_clear()


def test_a_missing_library_says_how_it_is_built(elsewhere):
    with pytest.raises(ToolchainError, match=r"libcorrelate\.so.*`pip install \.`, or build it in the checkout"):
        core()


def test_a_damaged_library_says_the_same(elsewhere):
    elsewhere.write_bytes(b"no library")
    with pytest.raises(ToolchainError, match="cannot be loaded"):
        core()


def test_a_library_built_from_other_sources_is_not_used(elsewhere, monkeypatch):
    shutil.copy(Path(pipeline.__file__).parent / "dic" / "libcorrelate.so", elsewhere)
    monkeypatch.setattr(library, "VERSION", 99)
    with pytest.raises(ToolchainError, match=r"has interface \d+, 99 is needed"):
        core()
