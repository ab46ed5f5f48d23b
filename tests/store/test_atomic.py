"""Files that are whole or not there, whatever happens to the disk."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import pipeline
from pipeline.core.errors import StoreError
from pipeline.store.atomic import write_atomically

ROOT = Path(pipeline.__file__).resolve().parents[1]


def run(code: str, *arguments: object, user: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own, whose limits and rights may be lowered."""
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True, text=True, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, user=user, check=False,
    )  # fmt: skip


def test_content_arrives_and_replaces_what_was_there(tmp_path):
    for content in (b"one", b"two"):
        write_atomically(tmp_path / "x", content)
        assert (tmp_path / "x").read_bytes() == content
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


FULL = """
import resource, sys
from pathlib import Path
from pipeline.core.errors import StoreError
from pipeline.store.atomic import write_atomically
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    write_atomically(Path(sys.argv[1]), bytes(5000))
except StoreError as error:
    print(error)
"""


def test_a_file_that_grows_too_large_leaves_the_old_one(tmp_path):
    """RLIMIT_FSIZE makes the system refuse in the middle of writing, as a full disk does."""
    (tmp_path / "x").write_bytes(b"old")
    done = run(FULL, tmp_path / "x")
    assert f"{tmp_path / 'x'} cannot be written: the file would be larger" in done.stdout, done.stderr
    assert (tmp_path / "x").read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 64 kB; needs the right to mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if (
        os.geteuid() != 0
        or subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True, check=False
        ).returncode
    ):
        pytest.skip("mounting a small file system needs root; the same path is tested with RLIMIT_FSIZE")
    yield disk
    subprocess.run(["umount", disk], check=True)


def test_a_disk_really_full_leaves_earlier_files_and_no_half_one(small_disk):
    write_atomically(small_disk / "early", bytes(20_000))
    with pytest.raises(StoreError, match="the disk is full: free some space"):
        write_atomically(small_disk / "late", bytes(100_000))
    assert [p.name for p in small_disk.iterdir()] == ["early"]
    assert (small_disk / "early").read_bytes() == bytes(20_000)


def test_a_read_only_disk_is_named(small_disk):
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    with pytest.raises(StoreError, match="the file system is read-only: choose another output folder"):
        write_atomically(small_disk / "x", b"1")


def test_a_missing_folder_and_a_folder_in_the_way_are_named(tmp_path):
    with pytest.raises(StoreError, match="the folder does not exist"):
        write_atomically(tmp_path / "no" / "x", b"1")
    (tmp_path / "x").mkdir()
    with pytest.raises(StoreError, match="a folder stands where the file is to be written"):
        write_atomically(tmp_path / "x", b"1")
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


KILLED = """
import os, signal, sys
from pathlib import Path
from pipeline.store import atomic
setattr(atomic.os, sys.argv[2], lambda *rest: os.kill(os.getpid(), signal.SIGKILL))
atomic.write_atomically(Path(sys.argv[1]), b"new" * 1000)
"""


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_killed_writer_leaves_the_old_file(tmp_path, step):
    (tmp_path / "x").write_bytes(b"old")
    assert run(KILLED, tmp_path / "x", step).returncode == -9
    assert (tmp_path / "x").read_bytes() == b"old"
