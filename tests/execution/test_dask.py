"""dask.distributed as the executor: two workers, one of them killed in the middle."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from execution.fake_engine import FolderStore, Task, meet, simulate
from execution.test_processes import gone
from execution.test_simulations import Diary, assert_answers, tasks

from pipeline.core.errors import ConvergenceError, InputError, ToolchainError
from pipeline.execution.dask_workers import DaskWorkers, executor_of
from pipeline.execution.processes import WorkerLostError
from pipeline.execution.serve import do_in_a_process
from pipeline.execution.simulations import SimulationError, run_all

pytest.importorskip("distributed", reason="dask.distributed is not installed: scripts/test installs it")


def test_a_worker_of_another_version_does_not_simulate() -> None:
    with pytest.raises(ToolchainError, match=r"has version .* of this package: install 0\.0\.1 there"):
        do_in_a_process(b"", "0.0.1")


class Cluster:
    """A scheduler and workers of one thread, each a process of its own."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.file = folder / "scheduler.json"
        self.folder = folder
        self.scheduler = self._start("scheduler", "--port", "0", "--scheduler-file", self.file, "--no-dashboard")
        meet(self.file.exists, 60)
        self.address = json.loads(self.file.read_text())["address"]
        self.workers = [self.add() for _ in range(workers)]

    def add(self) -> subprocess.Popen[bytes]:
        """One more worker."""
        more = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", self.folder)
        return self._start("worker", self.address, *more)

    def _start(self, *words: object) -> subprocess.Popen[bytes]:
        paths = os.pathsep.join(path for path in sys.path if path)
        line = [sys.executable, "-m", "dask", *map(str, words)]
        environment = os.environ | {"PYTHONPATH": paths}
        quiet = subprocess.DEVNULL
        return subprocess.Popen(line, env=environment, cwd=self.folder, stdout=quiet, stderr=quiet)

    def end(self) -> None:
        """Kill what was started, and wait until it is gone."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    folder = tmp_path / "dask"
    folder.mkdir()
    started = Cluster(folder, 2)
    try:
        yield started
    finally:
        started.end()


def test_a_killed_worker_is_reported_and_its_simulation_tried_again(cluster: Cluster, tmp_path: Path) -> None:
    wanted = {f"key{n}": Task(n, tmp_path, seconds=0.5) for n in range(5)}
    killed: list[int] = []

    def kill_one_in_the_middle() -> None:
        meet(lambda: sum(len(task.attempts()) for task in wanted.values()) >= 3, 60)
        cluster.workers[0].send_signal(signal.SIGKILL)
        killed.append(cluster.workers[0].pid)

    killer, diary = threading.Thread(target=kill_one_in_the_middle), Diary()
    killer.start()
    with executor_of(cluster.address) as workers:
        run_all(simulate, wanted, FolderStore(tmp_path), executor=workers, progress=diary)
    killer.join()
    assert killed
    assert_answers(FolderStore(tmp_path), 0, 1, 2, 3, 4)
    lost = [entry for entry in diary.entries if entry[0] == "lost"]
    assert lost
    assert {entry[2] for entry in lost} == {WorkerLostError}
    done = [entry[1] for entry in diary.entries if entry[0] == "done"]
    assert sorted(done) == sorted(wanted), "each is kept once"
    again = {key for key, task in wanted.items() if len(task.attempts()) > 1}
    assert again <= {entry[1] for entry in lost}, "only what was lost ran twice"
    meet(lambda: all(gone(pid) for task in wanted.values() for pid in task.attempts()), 10)


def test_errors_come_back_as_they_are_and_a_crash_is_a_lost_worker(cluster: Cluster, tmp_path: Path) -> None:
    wanted = tasks(tmp_path, 3, key0="raise", key1="die")
    with executor_of(cluster.address) as workers, pytest.raises(SimulationError) as caught:
        run_all(simulate, wanted, FolderStore(tmp_path), executor=workers)
    assert_answers(FolderStore(tmp_path), 2)
    assert isinstance(caught.value.failures["key0"], ConvergenceError)
    assert "signal 9" in str(caught.value.failures["key1"])
    assert len(wanted["key1"].attempts()) == 2, "tried again once"


def test_no_scheduler_is_said_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.execution.dask_workers.PATIENCE", 0.5)
    with pytest.raises(InputError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9: start one"):
        DaskWorkers("tcp://127.0.0.1:9")


def test_without_an_address_the_local_processes_run() -> None:
    with executor_of(None) as workers:
        assert workers is None
