"""The output folder: JSON that every reader takes, arrays by layout, refusals before long work."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from enum import StrEnum
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pipeline
from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.store.layouts import FIELDS
from pipeline.store.results import plain, prepare_output, read_arrays, read_result, write_arrays, write_result

ROOT = Path(pipeline.__file__).resolve().parents[1]
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


class Verdict(StrEnum):
    CAUSE = "cause"


@settings(max_examples=40)
@given(st.dictionaries(st.text(), JSON, max_size=5))
def test_what_json_knows_comes_back_the_same(tmp_path_factory, result):
    folder = tmp_path_factory.mktemp("out")
    write_result(folder, result)
    assert read_result(folder) == result


def test_numpy_paths_and_enums_become_plain_and_nan_null(tmp_path):
    result = {
        "array": np.array([[1.0, np.nan], [np.inf, 2.0]]),
        "scalar": np.float32(0.5),
        "count": np.int64(7),
        "flag": np.bool_(True),
        "nan": float("nan"),
        "path": Path("a/b"),
        "verdict": Verdict.CAUSE,
        "tuple": (1, None),
        "set": {"b", "a"},
        3: "number as key",
    }
    write_result(tmp_path, result)
    assert read_result(tmp_path) == {
        "array": [[1.0, None], [None, 2.0]],
        "scalar": 0.5,
        "count": 7,
        "flag": True,
        "nan": None,
        "path": "a/b",
        "verdict": "cause",
        "tuple": [1, None],
        "set": ["a", "b"],
        "3": "number as key",
    }
    assert "NaN" not in (tmp_path / "result.json").read_text()


def test_the_same_result_gives_the_same_bytes_whatever_the_order(tmp_path):
    write_result(tmp_path, {"b": 1, "a": {"d": 2, "c": 3}})
    first = (tmp_path / "result.json").read_bytes()
    write_result(tmp_path, {"a": {"c": 3, "d": 2}, "b": 1})
    assert (tmp_path / "result.json").read_bytes() == first
    assert list(json.loads(first)) == ["a", "b"]


def test_what_json_does_not_know_is_refused_and_the_old_result_stays(tmp_path):
    write_result(tmp_path, {"a": 1})
    with pytest.raises(InputError, match="a function cannot be written"):
        write_result(tmp_path, {"a": plain})
    assert read_result(tmp_path) == {"a": 1}


def test_missing_and_damaged_results_are_named(tmp_path):
    with pytest.raises(MissingFileError, match=r"result\.json does not exist"):
        read_result(tmp_path)
    (tmp_path / "result.json").write_text('{"a": ')
    with pytest.raises(StoreError, match=r"result\.json is damaged"):
        read_result(tmp_path)


def test_arrays_follow_a_layout(tmp_path):
    values = {
        "points": np.zeros((3, 2)),
        "displacement": np.ones((2, 3, 2)),
        "time_s": np.array([0.0, 1.0]),
        "valid": np.ones((2, 3), bool),
        "std_mm": 2e-4,
    }
    write_arrays(tmp_path, FIELDS, values)
    read = read_arrays(tmp_path, FIELDS)
    assert all(np.array_equal(read[name], value) for name, value in values.items())
    with pytest.raises(StoreError, match="points has shape"):
        write_arrays(tmp_path, FIELDS, values | {"points": np.zeros(3)})


def test_a_folder_is_made_with_its_parents_and_left_clean(tmp_path):
    out = prepare_output(tmp_path / "a" / "b")
    assert out.is_dir()
    assert list(out.iterdir()) == []
    assert prepare_output(out) == out


def test_a_file_in_the_way_is_named(tmp_path):
    (tmp_path / "out").write_text("mine")
    for folder in (tmp_path / "out", tmp_path / "out" / "deeper"):
        with pytest.raises(StoreError, match=r"out.* cannot be written: a file stands where a folder is needed"):
            prepare_output(folder)
    assert (tmp_path / "out").read_text() == "mine"


REFUSED = """
import os, sys
from pathlib import Path
from pipeline.core.errors import StoreError
from pipeline.store.results import prepare_output
if os.geteuid() == 0:
    os.setuid(65534)
try:
    prepare_output(Path(sys.argv[1]))
except StoreError as error:
    print(error)
"""


@pytest.mark.parametrize("inside", [".", "new"])
def test_a_folder_without_the_right_to_write_is_named(tmp_path, inside):
    """As a user without privileges; root lays its own down first."""
    (tmp_path / "locked").mkdir()
    for folder in (tmp_path, *list(tmp_path.parents)[:1]):
        folder.chmod(0o755)
    (tmp_path / "locked").chmod(0o555)
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", REFUSED, str(tmp_path / "locked" / inside)],
        capture_output=True, text=True, cwd=ROOT, env=env, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "cannot be written: permission is denied: choose another output folder" in done.stdout


def test_a_read_only_disk_is_named(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "ro,size=64k", "tmpfs", str(disk)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a read-only file system needs root; a folder without rights is tested instead")
    try:
        with pytest.raises(StoreError, match="the file system is read-only"):
            prepare_output(disk)
    finally:
        subprocess.run(["umount", str(disk)], check=True)
