"""The manifest and the lists of checksums: what is written is read, what was changed is refused."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import MissingFileError, StoreError
from pipeline.hpc.checksums import changed, checksum_list, checksums, read_checksum_list
from pipeline.hpc.manifest import FILE, Manifest, Point, manifest_text, read_manifest, study_of

POINTS = (Point(0, 64.0, 1e-4, "a" * 64, "b" * 64), Point(1, 71.0, 1.14e-4, "c" * 64, "d" * 64))


def manifest(name: str = "seb-07") -> Manifest:
    """A manifest of two points."""
    keys = [point.key for point in POINTS]
    engine, versions = "lammps 1", {"22 Jul 2025": "tested"}
    return Manifest(study_of(keys), "1", name, "cohesive", engine, {"accuracy": 0.01}, versions, POINTS, {"a": "b"})


@given(st.text(max_size=30))
def test_what_is_written_is_read(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    folder = tmp_path_factory.mktemp("study")
    if name.encode("utf-8", "ignore").decode() != name:  # half a surrogate pair is no name
        return
    (folder / FILE).write_text(manifest_text(manifest(name)), encoding="utf-8")
    assert read_manifest(folder) == manifest(name)


def test_a_folder_without_a_manifest_is_no_study(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"is no exported study: manifest\.json is missing"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("edit", "told"),
    [
        (lambda text: text[: len(text) // 2], "is damaged"),
        (lambda text: text.replace("71.0", "72.0"), "was changed after it was written"),
        (lambda text: json.dumps({"points": []}), "manifest of another program"),
        (lambda text: "[]", "manifest of another program"),
        (lambda text: text.replace('"format": 1', '"format": 2'), "has format 2, this version reads 1"),
        (lambda text: "\x00" + text, "is damaged"),
        (lambda text: "[" * 200_000, "is damaged"),
    ],
)
def test_a_manifest_that_was_changed_is_refused(tmp_path: Path, edit, told: str) -> None:
    (tmp_path / FILE).write_text(edit(manifest_text(manifest())), encoding="utf-8")
    with pytest.raises(StoreError, match=told):
        read_manifest(tmp_path)


def test_a_list_of_checksums_is_that_of_sha256sum(tmp_path: Path) -> None:
    (tmp_path / "a b").write_text("one")
    (tmp_path / "c").write_text("two")
    digests = checksums(tmp_path, ["c", "a b"])
    text = checksum_list(digests, "a title")
    assert read_checksum_list(text) == digests
    (tmp_path / "list").write_text(text)
    program = shutil.which("sha256sum")
    if program is None:
        pytest.skip("sha256sum of the coreutils is not here")
    checked = subprocess.run([program, "-c", "--strict", "list"], cwd=tmp_path, capture_output=True, check=False)
    assert checked.returncode == 0, checked.stderr
    (tmp_path / "c").write_text("TWO")
    (tmp_path / "a b").unlink()
    assert changed(tmp_path, digests) == [
        "a b is missing",
        "c has another checksum than when it was written",
    ]
