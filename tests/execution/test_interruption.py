"""Stopping a long run in the middle: from the terminal, or by killing it; then going on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
from execution.fake_engine import FolderStore, Task, answer, command, meet
from execution.test_processes import gone

COUNT = 4


def start(folder: Path) -> subprocess.Popen[str]:
    """A run of its own process group on two workers, as from a terminal."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    line = [sys.executable, "-m", "execution.fake_engine", str(folder), str(COUNT), "0.5"]
    pipe = subprocess.PIPE
    return subprocess.Popen(line, env=environment, start_new_session=True, stdout=pipe, stderr=pipe, text=True)


def wait_for_the_middle(folder: Path) -> list[int]:
    """Wait until one simulation is kept and another two run; process numbers of all that were started."""
    attempts = [Task(n, folder).attempts for n in range(COUNT)]
    meet(lambda: list(FolderStore(folder)) and sum(len(of()) for of in attempts) >= 3)
    return [pid for of in attempts for pid in of()]


def go_on(folder: Path) -> None:
    """Finish the run: what was kept is not simulated again, and all results are those of an uninterrupted run."""
    kept = {key: len(Task(int(key[3:]), folder).attempts()) for key in FolderStore(folder)}
    assert 0 < len(kept) < COUNT
    assert command(folder, COUNT, 0.0) == 0
    assert {key: len(Task(int(key[3:]), folder).attempts()) for key in kept} == kept
    for n in range(COUNT):
        np.testing.assert_array_equal(FolderStore(folder).get(f"key{n}"), answer(n))  # the same bits


def test_an_interrupt_keeps_what_is_finished_and_says_how_to_go_on(tmp_path):
    run = start(tmp_path)
    workers = wait_for_the_middle(tmp_path)
    os.killpg(run.pid, signal.SIGINT)
    out, err = run.communicate(timeout=10)  # promptly: a second for killing, the rest for a busy machine
    kept = len(list(FolderStore(tmp_path)))
    assert run.returncode == 130
    assert out == f"{kept} of {COUNT} simulations are kept: give the same command again to go on from there\n"
    assert err == ""
    meet(lambda: all(gone(pid) for pid in workers))
    go_on(tmp_path)


def test_workers_end_when_their_parent_is_killed_and_the_run_goes_on_later(tmp_path):
    run = start(tmp_path)
    workers = wait_for_the_middle(tmp_path)
    os.kill(run.pid, signal.SIGKILL)
    run.communicate(timeout=10)
    assert run.returncode == -signal.SIGKILL
    meet(lambda: all(gone(pid) for pid in workers), seconds=5)
    go_on(tmp_path)
