"""Stores of solutions: on disk and in memory under the same tests; damage on disk under its own."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.core.errors import StoreError
from pipeline.core.problem import Solution
from pipeline.store.simulation import MemoryStore, SimulationStore

ROOT = Path(pipeline.__file__).resolve().parents[1]
KEY, OTHER = "a" * 64, "b" * 64


@pytest.fixture(params=["memory", "disk"])
def store(request, tmp_path):
    return MemoryStore() if request.param == "memory" else SimulationStore(tmp_path / "simulations")


@pytest.fixture
def disk(tmp_path) -> SimulationStore:
    return SimulationStore(tmp_path / "simulations")


def assert_same(read: Solution, put: Solution) -> None:
    for name in ("time", "cmod", "load", "load_line"):
        assert np.array_equal(getattr(read.curve, name), getattr(put.curve, name))
    assert np.array_equal(read.cmod, put.cmod)
    assert np.array_equal(read.reached, put.reached)
    # single precision keeps 24 bits: half a unit of the last is 2^-24 = 6e-8 relative
    assert np.allclose(read.displacement, put.displacement, rtol=2**-24, atol=0)
    assert read.displacement.dtype == float
    rest = ("energy", "steps", "seconds", "quasi_static_error", "engine", "converged", "message")
    assert [getattr(read, name) for name in rest] == [getattr(put, name) for name in rest]


def test_put_then_get_is_the_identity(store, solution):
    assert store.get(KEY) is None
    assert KEY not in store
    store.put(KEY, solution)
    assert KEY in store
    assert store.keys() == (KEY,)
    assert_same(store.get(KEY), solution)


def test_a_second_put_replaces_the_first(store, solution):
    store.put(KEY, solution)
    store.put(KEY, replace(solution, steps=7, converged=False))
    assert store.get(KEY).steps == 7
    assert store.get(KEY).converged is False
    assert store.keys() == (KEY,)


def test_keys_are_sorted_and_solutions_kept_apart(store, solution):
    store.put(OTHER, replace(solution, steps=1))
    store.put(KEY, solution)
    assert store.keys() == (KEY, OTHER)
    assert (store.get(KEY).steps, store.get(OTHER).steps) == (solution.steps, 1)


def test_a_change_of_the_array_afterwards_does_not_reach_the_store(store, solution):
    displacement = solution.displacement.copy()
    store.put(KEY, replace(solution, displacement=displacement))
    displacement[:] = 0
    assert_same(store.get(KEY), solution)


def test_curves_with_and_without_a_load_line_and_not_a_number_are_kept(store, solution):
    bare = replace(solution, curve=replace(solution.curve, load_line=None), quasi_static_error=float("nan"))
    store.put(KEY, bare)
    assert store.get(KEY).curve.load_line is None
    assert np.isnan(store.get(KEY).quasi_static_error)


def test_a_solution_without_frames_is_kept(store, solution):
    store.put(KEY, replace(solution, cmod=solution.cmod[:0], displacement=solution.displacement[:0]))
    assert store.get(KEY).displacement.shape == (0, 50, 2)


@pytest.mark.parametrize("tenth", range(10))
def test_a_truncated_file_is_moved_aside_named_and_counts_as_absent(disk, solution, tenth, caplog):
    disk.put(KEY, solution)
    disk.put(OTHER, solution)
    content = disk.path(KEY).read_bytes()
    disk.path(KEY).write_bytes(content[: len(content) * tenth // 10])
    with caplog.at_level(logging.WARNING):
        assert disk.get(KEY) is None
    aside = disk.folder / f"{KEY}.h5.damaged"
    assert disk.damaged == [aside]
    assert aside.stat().st_size == len(content) * tenth // 10
    assert f"{KEY}.h5: it is" in caplog.text
    assert f"Moved to {aside.name}; this simulation will run again" in caplog.text
    assert disk.keys() == (OTHER,)
    assert_same(disk.get(OTHER), solution)
    disk.put(KEY, solution)
    assert_same(disk.get(KEY), solution)


def test_changed_bits_never_change_an_array(disk, solution):
    """Every 97th byte in turn: arrays are right or the file is refused (check sums in the file)."""
    disk.put(KEY, solution)
    content = disk.path(KEY).read_bytes()
    for at in range(0, len(content), 97):
        disk.path(KEY).write_bytes(content[:at] + bytes([content[at] ^ 4]) + content[at + 1 :])
        read = disk.get(KEY)
        assert read is None or np.array_equal(read.displacement, np.float32(solution.displacement).astype(float))
        assert read is None or np.array_equal(read.curve.load, solution.curve.load)
    assert len(disk.damaged) > len(content) // 97 // 2  # most bytes are numbers


def test_a_file_under_a_wrong_name_is_not_trusted(disk, solution):
    disk.put(KEY, solution)
    disk.path(KEY).rename(disk.path(OTHER))
    assert OTHER not in disk
    assert disk.damaged == [disk.folder / f"{OTHER}.h5.damaged"]


def test_damaged_files_do_not_overwrite_each_other(disk):
    for _ in range(3):
        disk.path(KEY).write_bytes(b"broken")
        assert disk.get(KEY) is None
    assert sorted(p.name for p in disk.folder.iterdir()) == [
        f"{KEY}.h5.damaged",
        f"{KEY}.h5.damaged-1",
        f"{KEY}.h5.damaged-2",
    ]


def test_what_a_killed_writer_left_is_ignored_and_swept(disk, solution):
    disk.put(KEY, solution)
    (disk.folder / f".{OTHER}.h5.99-1.part").write_bytes(b"half")
    assert disk.keys() == (KEY,)
    assert disk.sweep() == 1
    assert [p.name for p in disk.folder.iterdir()] == [f"{KEY}.h5"]


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "x").write_text("")
    with pytest.raises(StoreError, match=r"simulations cannot be written: a file stands where a folder"):
        SimulationStore(tmp_path / "x" / "simulations")


FILL = """
import resource, sys
from pathlib import Path
import numpy as np
from pipeline.core.curve import LoadCurve
from pipeline.core.errors import StoreError
from pipeline.core.problem import EnergyBalance, Solution
from pipeline.store.simulation import SimulationStore
x = np.linspace(0, 1, 50)
noise = np.random.default_rng(0).normal(size=(2, int(sys.argv[2]), 2))
solution = Solution(LoadCurve(x, x, x), x[:2], noise, x, EnergyBalance(1, 1, 1), 0.0, 1, 1.0, "e", True, "")
store = SimulationStore(Path(sys.argv[1]))
store.put("a" * 64, solution.__class__(**{**vars(solution), "displacement": noise[:, :5]}))
if sys.argv[3] == "limit":
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
try:
    store.put("b" * 64, solution)
except StoreError as error:
    print(error)
assert store.get("a" * 64).displacement.shape == (2, 5, 2)
"""


@pytest.mark.parametrize("how", ["limit", "disk"])
def test_a_full_disk_loses_only_the_file_being_written(tmp_path, how):
    folder = tmp_path / "disk"
    folder.mkdir()
    if how == "disk":
        mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
        if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
            pytest.skip("mounting a small file system needs root; the same path is tested with RLIMIT_FSIZE")
    try:
        done = subprocess.run(
            [sys.executable, "-c", FILL, str(folder), "20000", how],
            capture_output=True, text=True, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert f"{'b' * 64}.h5 cannot be written: the" in done.stdout
        assert ("free some space" in done.stdout) == (how == "disk")
        assert [p.name for p in folder.iterdir()] == [f"{KEY}.h5"]
    finally:
        if how == "disk":
            subprocess.run(["umount", str(folder)], check=True)
