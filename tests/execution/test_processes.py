"""Local processes: what a worker may do, and what happens to it when its parent goes."""

from __future__ import annotations

import operator
import os
import signal
import time
from pathlib import Path

import pytest
from execution.fake_engine import Task, meet, simulate, threads_of_linear_algebra

from pipeline.core.errors import InputError
from pipeline.execution.processes import LocalProcesses, WorkerLostError, cores, workers_of


def gone(pid: int) -> bool:
    """Whether no process of this number runs any more; one that ended and was not yet asked for is gone too."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def test_ranks_never_share_a_processor():
    assert (workers_of(1, None), workers_of(1, 100)) == (None, 100), "one rank lets go of the processor"
    assert workers_of(cores(), None) == 1
    if cores() > 1:
        assert workers_of(2, None) == cores() // 2
        with pytest.raises(InputError, match=rf"times workers = {cores()} must not exceed the {cores()} processors"):
            workers_of(2, cores())
    with pytest.raises(InputError, match=rf"ranks = {cores() + 1} must not exceed"):
        workers_of(cores() + 1, None)


def test_a_result_comes_back():
    with LocalProcesses(1) as processes:
        assert processes.submit(operator.mul, 6, 7).result() == 42


def test_linear_algebra_is_single_threaded(tmp_path):
    with LocalProcesses(1) as processes:
        threads = processes.submit(threads_of_linear_algebra, Task(0, tmp_path)).result()
    assert threads.size > 0
    assert set(threads) == {1}


def test_no_more_processes_than_workers(tmp_path):
    tasks = [Task(n, tmp_path, seconds=0.3) for n in range(3)]
    with LocalProcesses(2) as processes:
        futures = [processes.submit(simulate, task) for task in tasks]
        most = 0
        while not all(future.done() for future in futures):
            alive = [pid for task in tasks for pid in task.attempts() if not gone(pid)]
            most = max(most, len(alive))
            time.sleep(0.02)
    assert most == 2


def test_kill_ends_what_runs_and_drops_what_waits(tmp_path):
    processes = LocalProcesses(1)
    tasks = [Task(n, tmp_path, seconds=60.0) for n in range(2)]
    running, waiting = [processes.submit(simulate, task) for task in tasks]
    meet(tasks[0].attempts)
    started = time.monotonic()
    processes.kill()
    assert time.monotonic() - started < 5  # a simulation would take a minute, a killed process a moment
    assert gone(tasks[0].attempts()[0])
    assert tasks[1].attempts() == []
    assert isinstance(running.exception(timeout=5), WorkerLostError)
    assert waiting.cancelled()


def test_an_interrupt_of_the_terminal_does_not_reach_the_workers(tmp_path):
    task = Task(0, tmp_path, seconds=1.0)
    with LocalProcesses(1) as processes:
        future = processes.submit(simulate, task)
        meet(task.attempts)
        os.kill(task.attempts()[0], signal.SIGINT)
        assert future.result().size == 500


def test_what_cannot_be_sent_is_an_error_and_not_a_wait():
    with LocalProcesses(1) as processes, pytest.raises((AttributeError, TypeError, ValueError)):
        processes.submit(lambda: 1).result(timeout=20)


def test_no_workers_are_refused():
    with pytest.raises(InputError, match="workers = 0"):
        LocalProcesses(0)


def test_cores_are_those_this_process_may_use():
    assert 1 <= cores() <= (os.cpu_count() or 1)
