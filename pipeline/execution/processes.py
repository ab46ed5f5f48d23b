"""Local processes: every call in a fresh process of its own, so that losing one loses nothing else.

The pools that keep their workers were looked at first. `ProcessPoolExecutor` and loky give up every call under way when
one worker dies; pebble's `ProcessPool` feeds all workers through one pipe and its locks, which a worker killed while it
reads takes with it. pebble's single process a call has neither weakness, starts in a second beside simulations of many,
and makes a result independent of what its process ran before.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ParamSpec, TypeVar

from pebble import ProcessExpired, concurrent
from threadpoolctl import threadpool_limits

from pipeline.core.errors import InputError, ProcessLostError, StoreError

P = ParamSpec("P")
T = TypeVar("T")

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class WorkerLostError(ProcessLostError):
    """The process of a simulation ended without a result."""


def cores() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def workers_of(ranks: int, workers: int | None) -> int | None:
    """Simulations at a time where each has MPI ranks: as asked for, or as many as the processors carry.

    Raises
    ------
    InputError
        where ranks would share a processor: they wait for each other without letting go of it
    """
    if ranks == 1:
        return workers
    if ranks * (workers or 1) > cores():
        asked = f"ranks = {ranks}" + (f" times workers = {workers}" if workers else "")
        raise InputError(f"{asked} must not exceed the {cores()} processors of this machine: ranks wait for each other")
    return workers or cores() // ranks


class LocalProcesses(Executor):
    """An executor that runs each call in a spawned process, at most `workers` at a time.

    A process that is lost fails only its own call, with WorkerLostError. `kill` stops everything at once. Should this
    process be killed, its workers end by themselves. Temporary files of all calls lie in one folder that goes with
    the executor, so that calls which were stopped leave nothing behind.

    Parameters
    ----------
    workers : int or None; None: as many as there are processors
    """

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise InputError(f"workers = {workers} must be at least 1")
        self._threads = ThreadPoolExecutor(workers or cores(), "simulation", initializer=_leave_interrupts_to_main)
        self._name = f"simulation {id(self):x}"  # of the processes of this executor
        self._lock = threading.Lock()
        self._killed = False
        self._scratch: TemporaryDirectory[str] | None = None

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Queue the call fn(*args, **kwargs); all of it and its result must be picklable."""
        return self._threads.submit(self._run, partial(fn, *args, **kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; wait for those under way."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        if wait and self._scratch is not None:
            self._scratch.cleanup()

    def kill(self) -> None:
        """End all processes, wait until they are gone, and drop all calls that have not finished."""
        with interrupts_ignored():
            with self._lock:
                self._killed = True
            self.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                if process.name == self._name:
                    process.kill()
                    process.join()
            self.shutdown()

    def _run(self, call: Callable[[], T]) -> T:
        try:
            return self._start(self._lay_down(call)).result()
        except ProcessExpired as error:
            raise WorkerLostError(epitaph(error.exitcode)) from error
        except BrokenPipeError as error:
            raise WorkerLostError("the process of this simulation was lost while it started") from error

    def _lay_down(self, call: Callable[[], T]) -> Path:
        """Write a call to a file: through the pipe of its start a process gets only as much as the pipe holds.

        More would be waited for until the process reads it, and so for ever where it is lost before.
        """
        try:
            with self._lock:
                if self._scratch is None:
                    self._scratch = TemporaryDirectory(prefix="cohesive-bpm-", ignore_cleanup_errors=True)
            handle, name = tempfile.mkstemp(suffix=".call", dir=self._scratch.name)
            with open(handle, "wb") as file:
                pickle.dump(call, file)
        except OSError as error:
            place = tempfile.gettempdir()
            raise StoreError(
                f"{place}: {error.strerror}: make room there, or let TMPDIR name another folder"
            ) from error
        return Path(name)

    def _start(self, call: Path) -> Future[Any]:
        context = multiprocessing.get_context("spawn")  # MPI and threads do not survive a fork
        with self._lock:
            if self._killed:
                raise CancelledError
            resource_tracker.ensure_running()  # its start lets interrupts through again
            _leave_interrupts_to_main()
            return concurrent.process(name=self._name, context=context)(_serve)(call)  # type: ignore[call-overload]


def epitaph(exitcode: int | None) -> str:
    """How a process ended, in a sentence."""
    if exitcode is None or exitcode >= 0:
        return f"the process of this simulation ended without a result (exit code {exitcode})"
    hint = ", perhaps for lack of memory: try fewer --workers" if exitcode == -signal.SIGKILL else ""
    return f"the process of this simulation was killed by signal {-exitcode}{hint}"


@contextmanager
def interrupts_ignored() -> Iterator[None]:
    """Let nothing, and nobody who presses Ctrl-C twice, stop the tidying up after the first."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _leave_interrupts_to_main() -> None:
    """Ctrl-C reaches every process of a terminal: processes started from this thread inherit that it is blocked."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def _serve(file: Path) -> Any:
    """In the worker: do the call of a file with single-threaded linear algebra; temporary files lie beside it."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # compiled code would never come back to a handler of Python's
    threading.Thread(target=_end_with_parent, args=(file.parent,), daemon=True).start()
    tempfile.tempdir = str(file.parent)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # for libraries that the call loads ...
    call = pickle.loads(file.read_bytes())
    file.unlink()
    with threadpool_limits(1):  # ... and for those that are loaded
        return call()


def _end_with_parent(scratch: Path) -> None:
    """End this process as soon as the one that started it is gone, however it went, and tidy up in its place."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        shutil.rmtree(scratch, ignore_errors=True)
        os._exit(1)
