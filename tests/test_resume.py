"""Long runs stopped in every way, from the command line: nothing finished is lost, run twice or changed."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.bundles import edit, make_bundle
from helpers.commands import alive, end_group, hears_interrupts, start, wait_for, workers
from typer.testing import CliRunner, Result

from pipeline.cli import app

GRID = ("--grid", "0.9,1,1.1", "--workers", "2", "--placements", "2")
NODES = 9


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle that identifies in seconds."""
    return make_bundle(tmp_path_factory.mktemp("bundles") / "coarse")


@pytest.fixture(scope="module")
def whole(bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of a run that nothing disturbed."""
    out = tmp_path_factory.mktemp("whole") / "out"
    run("identify", bundle, "-o", out, *GRID)
    return out


@pytest.fixture
def runs() -> Iterator[list[subprocess.Popen[str]]]:
    """Commands of a test, ended with it."""
    started: list[subprocess.Popen[str]] = []
    yield started
    for run in started:
        end_group(run)


def kept(out: Path) -> dict[str, tuple[int, int]]:
    """Simulations in OUT: name → inode and time, which change when one is written again."""
    found = {}
    for path in (out / "simulations").glob("*.h5"):
        status = path.stat()
        found[path.name] = (status.st_ino, status.st_mtime_ns)
    return found


def run(*line: object, ends: int = 0) -> Result:
    """The command in this process."""
    ended = CliRunner().invoke(app, [str(word) for word in line])
    assert ended.exit_code == ends, ended.stderr
    return ended


def result(out: Path) -> dict[str, Any]:
    """result.json but for the time it took."""
    found = json.loads((out / "result.json").read_text("utf-8"))
    del found["seconds"]
    return found


def test_a_grid_stopped_in_every_way_ends_with_the_result_of_an_undisturbed_run(bundle, whole, tmp_path, runs):
    """Ctrl-C, a worker killed, the command itself killed, a file cut off; the last call finishes."""
    out, scratch = tmp_path / "out", tmp_path / "scratch"

    runs.append(interrupted := start("identify", bundle, "-o", out, *GRID, scratch=scratch))
    wait_for(lambda: workers(interrupted.pid))
    os.kill(workers(interrupted.pid)[0], signal.SIGKILL)  # at its very start, before it has read its task
    wait_for(lambda: len(kept(out)) >= 2 and workers(interrupted.pid))
    spawned = workers(interrupted.pid)
    os.killpg(interrupted.pid, signal.SIGINT)  # as a terminal does
    said, told = interrupted.communicate(timeout=30)
    first = kept(out)
    assert (interrupted.returncode, said) == (130, "")
    assert told.splitlines()[-1] == (
        f"cohesive-bpm: stopped; {len(first)} of {NODES} simulations are kept: give the same command again to go on "
        "from there"
    )
    assert "killed by signal 9" in told
    assert "it is tried once more" in told
    assert "Traceback" not in told
    assert not any(alive(pid) for pid in spawned)
    assert list(scratch.iterdir()) == []
    assert not (out / "result.json").exists()

    runs.append(killed := start("identify", bundle, "-o", out, *GRID, scratch=scratch))
    wait_for(lambda: len(kept(out)) > len(first) and workers(killed.pid))
    spawned = workers(killed.pid)
    os.kill(killed.pid, signal.SIGKILL)
    _, told = killed.communicate(timeout=30)
    second = kept(out)
    assert killed.returncode == -signal.SIGKILL
    assert f"{len(first)} of {NODES} simulations are kept from an earlier run" in told
    wait_for(lambda: not any(alive(pid) for pid in spawned), seconds=10)
    wait_for(lambda: not list(scratch.iterdir()), seconds=10)
    assert first.items() <= second.items()  # not one was written again
    assert len(second) < NODES

    cut = out / "simulations" / min(second)
    os.truncate(cut, cut.stat().st_size // 2)
    runs.append(start("identify", bundle, "-o", out, *GRID, scratch=scratch))
    said, told = runs[-1].communicate(timeout=120)
    last = kept(out)
    assert runs[-1].returncode == 0, told
    assert f"{len(second) - 1} of {NODES} simulations are kept from an earlier run" in told
    assert f"Moved to {cut.name}.damaged; this simulation will run again" in told
    del second[cut.name]
    assert second.items() <= last.items()
    assert last.keys() == kept(whole).keys()  # nodes, optima, placements: not one more
    assert result(out) == result(whole)  # to the last bit: JSON holds the shortest text of each double
    assert (out / "results.h5").read_bytes() == (whole / "results.h5").read_bytes()


def test_a_finished_run_called_again_simulates_nothing(bundle, whole):
    before, found = kept(whole), result(whole)
    again = run("identify", bundle, "-o", whole, *GRID)
    assert f"{NODES} of {NODES} simulations are kept from an earlier run" in again.stderr
    assert kept(whole) == before
    assert result(whole) == found


def test_a_bundle_edited_in_between_gets_its_own_simulations_and_keeps_the_old_ones(bundle, tmp_path):
    edited, out = tmp_path / "edited", tmp_path / "out"
    shutil.copytree(bundle, edited)
    line = ("simulate", edited, "--f-max", "473", "--delta-max", "1.14e-4", "-o", out)
    run(*line)
    stale, first = kept(out), result(out)
    edit(edited, mastic_modulus_gpa="9.0")
    run(*line)
    before, after = (
        found["load_cmod"]["load_n"][9] / found["load_cmod"]["cmod_mm"][9] for found in (first, result(out))
    )
    assert after / before == pytest.approx(0.9, abs=0.01)  # as the mastic's modulus, but for one stone
    assert len(kept(out)) == 2
    assert stale.items() <= kept(out).items()
    edit(edited, mastic_modulus_gpa="10.0")
    run(*line)
    assert result(out) == first
    assert len(kept(out)) == 2


def test_an_impatient_interrupt_before_anything_is_finished_is_one_message(bundle, tmp_path, runs):
    out, scratch = tmp_path / "out", tmp_path / "scratch"
    runs.append(stopped := start("identify", bundle, "-o", out, *GRID, scratch=scratch))
    wait_for(lambda: len(workers(stopped.pid)) == 2)
    spawned = workers(stopped.pid)
    assert not any(hears_interrupts(pid) for pid in spawned)  # from their start: else they would tell of it
    for _ in range(3):
        os.killpg(stopped.pid, signal.SIGINT)
        time.sleep(0.05)
    said, told = stopped.communicate(timeout=30)
    assert stopped.returncode in (130, -signal.SIGINT)  # the same to a shell; the last may meet a process that leaves
    assert said == ""
    assert told.count("cohesive-bpm: stopped; ") == 1
    assert "give the same command again" in told
    assert "Traceback" not in told
    wait_for(lambda: not any(alive(pid) for pid in spawned), seconds=10)
    assert list(scratch.iterdir()) == []


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 4 MB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("nothing can be mounted here; tests/test_unwritable_places.py limits file sizes instead")
    yield disk
    subprocess.run(["umount", disk], check=True)


def test_a_disk_that_fills_up_in_the_middle_loses_nothing(bundle, whole, small_disk):
    """All but one of the simulations are there already, and no room for it."""
    out = small_disk / "out"
    shutil.copytree(whole / "simulations", out / "simulations")
    (out / "simulations" / min(kept(out))).unlink()
    before = kept(out)
    with contextlib.suppress(OSError), open(small_disk / "others", "wb", buffering=0) as others:
        while others.write(bytes(4096)):
            pass
    with open(small_disk / "others", "rb+") as others:
        others.truncate((small_disk / "others").stat().st_size - 3 * 4096)
    full = run("identify", bundle, "-o", out, *GRID, ends=1)
    assert full.stdout == ""
    assert full.stderr.count("cohesive-bpm: ") == 1
    assert re.search(r"cohesive-bpm: .*\.h5 cannot be written: the disk is full: free some space", full.stderr)
    assert kept(out) == before
    assert not list(out.rglob("*.part"))
    (small_disk / "others").unlink()
    run("identify", bundle, "-o", out, *GRID)
    assert before.items() <= kept(out).items()
    assert result(out) == result(whole)


@pytest.mark.slow
def test_a_grid_interrupted_over_and_over_ends_with_the_result_of_an_undisturbed_run(bundle, tmp_path, runs):
    """The paper's 5×5 grid, stopped at moments drawn by chance until nothing is left to stop."""
    chance, nodes = np.random.default_rng(0), 25
    out, line = tmp_path / "out", ("identify", bundle, "--workers", "2", "-o")
    code = 130
    while code == 130:
        before = kept(out)
        runs.append(start(*line, out, scratch=tmp_path / "scratch"))
        wait_for(lambda: workers(runs[-1].pid) or runs[-1].poll() is not None)
        with contextlib.suppress(subprocess.TimeoutExpired):
            runs[-1].wait(timeout=chance.uniform(0, 12))
        runs[-1].send_signal(signal.SIGINT)
        _, told = runs[-1].communicate(timeout=120)
        code = runs[-1].returncode
        assert code in (0, 130), told
        assert "Traceback" not in told
        assert before.items() <= kept(out).items()
    run(*line, tmp_path / "whole")
    assert len(kept(out)) >= nodes + 1
    assert kept(out).keys() == kept(tmp_path / "whole").keys()
    assert result(out) == result(tmp_path / "whole")
