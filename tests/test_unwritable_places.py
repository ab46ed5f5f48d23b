"""Places where results cannot be written: told in one message, and what stood there is left whole."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.bundles import edit
from helpers.commands import run, start
from helpers.refusals import PARAMETERS, assert_one_message, assert_refused, contents, lines


@pytest.fixture(scope="module")
def simulated(sound: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of one simulation of the sound bundle, and a deck."""
    out = tmp_path_factory.mktemp("results") / "out"
    for line in (("model", sound, "-o", out), ("simulate", sound, "-o", out, *PARAMETERS)):
        done = run(*line)
        assert done.exit_code == 0, done.stderr
    return out


@pytest.mark.parametrize("command", ["model", "simulate", "identify"])
@pytest.mark.parametrize("place", ["out", "out/below", "/dev/null", "/proc/out"])
def test_where_no_folder_can_be_is_refused(bundle, command, place):
    (bundle.parent / "out").write_text("precious")
    told = f"{bundle.parent / place} cannot be written: "
    assert_refused(bundle.parent, (*lines(command, bundle), "-o", bundle.parent / place), told, "choose another output")


@pytest.mark.parametrize("command", ["model", "simulate", "identify"])
@pytest.mark.parametrize("place", ["bundle", "bundle/images", "bundle/images/out"])
def test_results_are_kept_out_of_the_bundle_itself(bundle, command, place):
    assert_refused(bundle.parent, (*lines(command, bundle), "-o", bundle.parent / place), "choose another -o")
    assert run("check", bundle).exit_code == 0


def test_a_virtual_test_is_not_made_over_a_measured_one(bundle):
    told = "holds a bundle that is no virtual test (no truth.json)"
    assert_refused(bundle.parent, ("virtual-test", bundle, "--radius-mm", "2"), told)
    assert_refused(bundle.parent, ("new", bundle, "--geometry", "seb"), "is not empty")


def test_a_virtual_test_that_was_stopped_is_made_again_in_its_place(tmp_path):
    out = tmp_path / "virtual"
    line = ("virtual-test", out, "--radius-mm", "2")
    assert_refused(tmp_path, (*line, "--delta-max", "1e-8"), "must be larger than delta_peak")
    assert_refused(tmp_path, (*line, "--specimen", tmp_path / "no.png", "--mm-per-px", "1"), "no.png: does not exist")
    made = run(*line)
    assert made.exit_code == 0, made.stderr
    assert sorted(path.name for path in out.iterdir()) == [
        "experiment.toml",
        "fields.h5",
        "labels.png",
        "load_cmod.csv",
        "truth.json",
    ]
    assert run("check", out).exit_code == 0


def test_two_bundles_do_not_share_their_results(bundle, simulated, tmp_path):
    out = shutil.copytree(simulated, tmp_path / "out")
    edit(bundle, name='"another"')
    for command in ("model", "simulate", "identify"):
        assert_refused(tmp_path, lines(command, bundle), f"{out} holds the results of bundle 'coarse'")


def test_a_folder_where_simulations_cannot_be_kept_is_told_before_the_first(bundle, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "simulations").write_text("precious")
    for command in ("simulate", "identify"):
        assert_refused(tmp_path, lines(command, bundle), "a file stands where a folder is needed")


@contextlib.contextmanager
def files_limited_to(size: int) -> Iterator[None]:
    """No file of this process or those it starts may grow beyond a size."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize(
    ("command", "size", "file"),
    [("simulate", 40_000, "results.h5"), ("simulate", 200_000, "report.html"), ("model", 20_000, "lammps")],
)
def test_a_file_that_may_not_grow_leaves_what_was_there(simulated, sound, tmp_path, command, size, file):
    """The limit stands for a full disk: a write fails in the middle. The simulation itself is kept already."""
    out = Path(shutil.copytree(simulated, tmp_path / "out"))
    before = contents(out)
    with files_limited_to(size):
        ended = run(*lines(command, sound), "-o", out)
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert_one_message(
        ended.stderr, f"{out / file} cannot be written: the file would be larger than this system allows"
    )
    after = contents(out)
    assert before.keys() == after.keys()
    changed = {path.name for path in before if before[path] != after[path]}
    assert changed <= ({"result.json"} if file == "report.html" else set())  # its numbers are new, and whole
    json.loads((out / "result.json").read_text("utf-8"))


def test_a_scratch_folder_that_is_full_is_named(sound, tmp_path, monkeypatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    with files_limited_to(10_000):
        ended = run(*lines("simulate", sound), "-o", tmp_path / "out")
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert_one_message(ended.stderr, f"{scratch}: File too large", "let TMPDIR name another folder")
    assert list(scratch.iterdir()) == []


def without_rights(*line: object) -> subprocess.CompletedProcess[str]:
    """The command as somebody whom permissions bind, which root is not."""
    prefix: list[str] = []
    if os.geteuid() == 0:
        if shutil.which("setpriv") is None:
            pytest.skip("permissions do not bind root, and setpriv is not here to make them")
        prefix = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"]
    command = [*prefix, sys.executable, "-m", "pipeline", *map(str, line)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)


def test_missing_permissions_are_told(bundle, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir()
    closed.chmod(0o555)
    ended = without_rights("model", bundle, "-o", closed / "out")
    assert ended.returncode == 1
    assert_one_message(ended.stderr, f"{closed / 'out'} cannot be written: permission is denied")
    for name in ("load_cmod.csv", "fields.h5", "labels.png"):
        (bundle / name).chmod(0)
    ended = without_rights("check", bundle)
    assert ended.returncode == 1
    told = ("load_cmod.csv: cannot be read", "fields.h5: there is no permission", "labels.png: cannot be read")
    assert_one_message(ended.stderr, *told)


def test_a_reader_who_leaves_is_no_error_worth_words(sound):
    process = start("check", sound, scratch=sound.parent / "scratch")
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(timeout=60) in (1, -signal.SIGPIPE)
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()
