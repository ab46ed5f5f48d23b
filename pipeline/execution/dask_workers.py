"""Workers of dask.distributed as an executor of concurrent.futures: simulations on other machines."""

from __future__ import annotations

import contextlib
import pickle
import threading
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, InvalidStateError
from functools import partial
from typing import Any, ParamSpec, TypeVar

from pipeline import __version__
from pipeline.core.errors import InputError, ToolchainError
from pipeline.execution.processes import WorkerLostError
from pipeline.execution.serve import do_in_a_process

P = ParamSpec("P")
T = TypeVar("T")

PATIENCE = 15.0  # s, for the scheduler to answer


class DaskWorkers(Executor):
    """An executor that runs each call in a process of its own beside a worker of a dask scheduler.

    dask would start the calls of a worker that is lost again without a word; here they fail with
    WorkerLostError, so that whoever submitted them hears of it and decides.

    Parameters
    ----------
    address : str, as in tcp://host:8786

    Raises
    ------
    ToolchainError
        where dask.distributed is not installed
    InputError
        where no scheduler answers at the address
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise ToolchainError("--dask needs dask.distributed: install 'cohesive-bpm[dask]'") from error
        try:
            self._client = Client(address, timeout=PATIENCE, set_as_default=False, name="cohesive-bpm")
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(
                f"no dask scheduler answers at {address}: start one with 'dask scheduler', and give the address it "
                "prints, as in tcp://host:8786"
            ) from error
        self._address, self._lock = address, threading.Lock()
        self._running: dict[str, tuple[Future[Any], Any]] = {}  # by key: the caller's future and dask's
        self._client.subscribe_topic("all", self._hear)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Queue the call fn(*args, **kwargs); all of it and its result must be picklable.

        Raises
        ------
        BrokenExecutor
            where the scheduler is gone
        """
        if self._client.status != "running":
            raise BrokenExecutor(f"the dask scheduler at {self._address} is gone")
        future: Future[T] = Future()
        key = f"simulation-{uuid.uuid4().hex}"
        call = pickle.dumps(partial(fn, *args, **kwargs))
        with self._lock:
            task = self._client.submit(do_in_a_process, call, __version__, key=key, pure=False, retries=0)
            self._running[key] = (future, task)
        task.add_done_callback(partial(self._settle, key))
        future.add_done_callback(partial(self._forget, key))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let go of the scheduler, which is not ours to stop; calls that wait are dropped with `cancel_futures`."""
        if cancel_futures:
            with self._lock:
                tasks = [task for _, task in self._running.values()]
            self._client.cancel(tasks)
        elif wait:
            with self._lock:
                futures = [future for future, _ in self._running.values()]
            for future in futures:
                with contextlib.suppress(BaseException):
                    future.result()
        self._client.close()

    def _settle(self, key: str, task: Any) -> None:
        """Hand on what dask says of a call; in a thread of dask."""
        with self._lock:
            found = self._running.get(key)
        if found is None:
            return
        with contextlib.suppress(InvalidStateError):  # it was cancelled, or its worker was lost, just now
            if task.status == "finished":
                found[0].set_result(task.result())
            else:
                found[0].set_exception(_ours(task.exception() if task.status == "error" else None))

    def _hear(self, event: tuple[Any, Any]) -> None:
        """Fail the calls of a worker that has left with work or results on it; in dask's event loop."""
        _, told = event
        if isinstance(told, dict) and told.get("action") == "remove-worker":
            keys = {*told.get("processing-tasks", ()), *told.get("lost-computed-tasks", ())}
            threading.Thread(target=self._lose, args=(keys, told.get("worker", "")), daemon=True).start()

    def _lose(self, keys: set[str], worker: str) -> None:
        for key in keys:
            with self._lock:
                found = self._running.get(key)
            if found is None:
                continue
            future, task = found
            with contextlib.suppress(InvalidStateError):
                future.set_exception(WorkerLostError(f"the dask worker {worker} was lost"))
            task.cancel(force=True)

    def _forget(self, key: str, future: Future[Any]) -> None:
        """A call is over for its caller: nobody needs dask's side of it any more."""
        with self._lock:
            found = self._running.pop(key, None)
        if found is not None and future.cancelled():
            found[1].cancel()


def _ours(error: BaseException | None) -> BaseException:
    """The error of a call; one of dask's own about lost workers becomes ours."""
    from distributed.client import FutureCancelledError
    from distributed.scheduler import KilledWorker

    if error is None or isinstance(error, KilledWorker | FutureCancelledError):
        return WorkerLostError(f"the dask worker of this simulation was lost: {error or 'the scheduler dropped it'}")
    return error


@contextlib.contextmanager
def executor_of(address: str | None) -> Iterator[Executor | None]:
    """The executor of a dask address, closed at the end; None, the local processes, without one."""
    if address is None:
        yield None
        return
    workers = DaskWorkers(address)
    try:
        yield workers
    finally:
        workers.shutdown(cancel_futures=True)
