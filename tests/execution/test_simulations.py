"""Many simulations: what is finished stays, what is lost is tried again, what fails is named."""

from __future__ import annotations

import errno
import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from execution.fake_engine import FolderStore, Task, answer, meet, simulate

from pipeline.core.errors import ConvergenceError, PipelineError
from pipeline.execution.processes import WorkerLostError
from pipeline.execution.simulations import SimulationError, run_all


class Diary:
    """A progress that remembers what it was told."""

    def __init__(self) -> None:
        self.entries: list[tuple] = []

    def stage(self, name: str) -> None:
        self.entries.append(("stage", name))

    def begin(self, total: int, kept: int) -> None:
        self.entries.append(("begin", total, kept))

    def done(self, key: str) -> None:
        self.entries.append(("done", key))

    def lost(self, key: str, error: BaseException) -> None:
        self.entries.append(("lost", key, type(error)))

    def failed(self, key: str, error: BaseException) -> None:
        self.entries.append(("failed", key, type(error)))


def tasks(folder: Path, count: int, **acts: str) -> dict[str, Task]:
    """`count` tasks key0, key1, …; acts by key."""
    return {f"key{n}": Task(n, folder, act=acts.get(f"key{n}", "")) for n in range(count)}


def assert_answers(store: FolderStore, *numbers: int) -> None:
    """The store holds exactly the answers of these tasks."""
    assert list(store) == [f"key{n}" for n in numbers]
    for n in numbers:
        np.testing.assert_array_equal(store.get(f"key{n}"), answer(n))  # same code, same seed: the same bits


def test_every_problem_is_simulated_once_and_kept(tmp_path):
    diary = Diary()
    wanted = tasks(tmp_path, 4)
    run_all(simulate, wanted, FolderStore(tmp_path), workers=2, progress=diary)
    assert_answers(FolderStore(tmp_path), 0, 1, 2, 3)
    assert [len(task.attempts()) for task in wanted.values()] == [1, 1, 1, 1]
    assert len({os.getpid(), *(task.attempts()[0] for task in wanted.values())}) == 5  # a process for each
    assert diary.entries[0] == ("begin", 4, 0)
    assert sorted(diary.entries[1:]) == [("done", f"key{n}") for n in range(4)]


def test_what_is_kept_is_not_simulated_again(tmp_path):
    store, diary, wanted = FolderStore(tmp_path), Diary(), tasks(tmp_path, 3)
    store.put("key1", answer(1))
    run_all(simulate, wanted, store, workers=2, progress=diary)
    assert_answers(store, 0, 1, 2)
    assert wanted["key1"].attempts() == []
    assert diary.entries[0] == ("begin", 3, 1)


def test_nothing_is_started_when_everything_is_kept(tmp_path):
    store, diary = FolderStore(tmp_path), Diary()
    store.put("key0", answer(0))
    run_all(simulate, tasks(tmp_path, 1), store, progress=diary)
    assert diary.entries == [("begin", 1, 1)]


def test_workers_run_at_the_same_time(tmp_path):
    pair = {"key0": Task(0, tmp_path, partner=1), "key1": Task(1, tmp_path, partner=0)}  # each waits for the other
    run_all(simulate, pair, FolderStore(tmp_path), workers=2)
    assert_answers(FolderStore(tmp_path), 0, 1)


def test_a_worker_killed_from_outside_loses_only_its_own_simulation_and_that_is_tried_again(tmp_path):
    wanted = {"key0": Task(0, tmp_path, seconds=0.5), "key1": Task(1, tmp_path, seconds=0.5)}

    def kill_the_first() -> None:
        meet(wanted["key0"].attempts)
        os.kill(wanted["key0"].attempts()[0], signal.SIGKILL)

    killer, diary = threading.Thread(target=kill_the_first), Diary()
    killer.start()
    run_all(simulate, wanted, FolderStore(tmp_path), workers=2, progress=diary)
    killer.join()
    assert_answers(FolderStore(tmp_path), 0, 1)
    assert [len(task.attempts()) for task in wanted.values()] == [2, 1]
    assert ("lost", "key0", WorkerLostError) in diary.entries


def test_a_simulation_that_kills_its_worker_twice_is_given_up_and_named(tmp_path):
    wanted, diary = tasks(tmp_path, 3, key1="die"), Diary()
    with pytest.raises(SimulationError, match=r"1 of 3 simulations failed[\s\S]*key1: .*signal 9") as caught:
        run_all(simulate, wanted, FolderStore(tmp_path), workers=2, progress=diary)
    assert_answers(FolderStore(tmp_path), 0, 2)
    assert len(wanted["key1"].attempts()) == 2
    assert isinstance(caught.value.failures["key1"], WorkerLostError)
    assert ("failed", "key1", WorkerLostError) in diary.entries


def test_a_simulation_that_fails_is_named_and_the_others_finish(tmp_path):
    with pytest.raises(SimulationError, match="task 0 did not converge") as caught:
        run_all(simulate, tasks(tmp_path, 3, key0="raise", key2="raise"), FolderStore(tmp_path), workers=2)
    assert_answers(FolderStore(tmp_path), 1)
    assert sorted(caught.value.failures) == ["key0", "key2"]
    assert isinstance(caught.value.failures["key0"], ConvergenceError)
    assert isinstance(caught.value, PipelineError)
    assert isinstance(caught.value.__cause__, ConvergenceError)


def test_names_stand_for_keys_in_what_is_told(tmp_path):
    diary, names = Diary(), {"key0": "f_max = 64 N", "key1": "f_max = 71 N"}
    with pytest.raises(SimulationError, match="f_max = 64 N: task 0 did not converge"):
        run_all(simulate, tasks(tmp_path, 2, key0="raise"), FolderStore(tmp_path), progress=diary, names=names)
    assert {entry[:2] for entry in diary.entries[1:]} == {("failed", "f_max = 64 N"), ("done", "f_max = 71 N")}


def test_one_reason_for_many_failures_is_said_once():
    error = SimulationError({"a": ValueError("no disk"), "b": ValueError("no disk"), "c": KeyError()}, 5)
    assert str(error).splitlines() == [
        "3 of 5 simulations failed, the others are kept",
        "a, b: no disk",
        "c: KeyError",
    ]


def test_a_store_that_refuses_stops_everything_at_once(tmp_path):
    class FullDisk(FolderStore):
        def put(self, key: str, solution: np.ndarray) -> None:
            raise OSError(errno.ENOSPC, "no space left", str(self.folder / key))

    wanted = {"key0": Task(0, tmp_path), **{f"key{n}": Task(n, tmp_path, seconds=60.0) for n in (1, 2, 3)}}
    started = time.monotonic()
    with pytest.raises(OSError, match="no space left"):
        run_all(simulate, wanted, FullDisk(tmp_path), workers=2)
    assert time.monotonic() - started < 30  # half of one of the simulations under way


def test_any_executor_will_do_and_is_left_open(tmp_path):
    with ThreadPoolExecutor(2) as threads:
        run_all(simulate, tasks(tmp_path, 3), FolderStore(tmp_path), executor=threads)
        assert threads.submit(int, "7").result() == 7
    assert_answers(FolderStore(tmp_path), 0, 1, 2)


def test_an_executor_that_breaks_is_reported_instead_of_waited_for(tmp_path):
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
        pytest.raises(SimulationError, match="2 of 2 simulations failed"),
    ):
        run_all(simulate, tasks(tmp_path, 2, key0="die"), FolderStore(tmp_path), executor=pool)
