"""Many simulations, each kept as soon as it is finished."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from typing import Protocol

from pipeline.core.errors import PipelineError, ProcessLostError
from pipeline.core.problem import Problem, Solution
from pipeline.execution.processes import LocalProcesses, interrupts_ignored
from pipeline.execution.progress import Progress, Silent

Simulate = Callable[[Problem], Solution]


class SolutionStore(Protocol):
    """Where solutions are kept; a key that is contained is not simulated again."""

    def __contains__(self, key: str) -> bool: ...
    def put(self, key: str, solution: Solution) -> None: ...


class SimulationError(PipelineError, RuntimeError):
    """One or more of many simulations failed; the others were finished and kept.

    Parameters
    ----------
    failures : key or name of a simulation → its error
    total : int; how many were wanted
    """

    def __init__(self, failures: Mapping[str, BaseException], total: int):
        super().__init__(failures, total)
        self.failures = dict(failures)
        self.total = total

    def __str__(self) -> str:
        if self.total == 1:
            return "".join(f"{key}: {_reason(error)}" for key, error in self.failures.items())
        by_message: dict[str, list[str]] = {}
        for key, error in self.failures.items():
            by_message.setdefault(_reason(error), []).append(key)
        head = f"{len(self.failures)} of {self.total} simulations failed, the others are kept"
        return "\n".join([head, *(f"{', '.join(keys)}: {message}" for message, keys in by_message.items())])


def _reason(error: BaseException) -> str:
    return f"{error}" or type(error).__name__


def run_all(
    simulate: Simulate,
    problems: Mapping[str, Problem],
    store: SolutionStore,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    names: Mapping[str, str] | None = None,
) -> None:
    """Simulate every problem whose key the store does not hold, and put each solution there as soon as it is finished.

    Parameters
    ----------
    simulate : takes a Problem, returns a Solution; picklable (a function of a module, or functools.partial of one)
    problems : key → Problem
    store : SolutionStore; written by this process only
    executor : any executor of concurrent.futures, left open; None: LocalProcesses(workers)
    workers : int or None; number of local processes, None: as many as there are processors
    progress : Progress or None
    names : key → what progress and errors call it; None: the key

    Raises
    ------
    SimulationError
        at the end, if simulations failed; one whose process was lost is tried once more first
    KeyboardInterrupt
        at once, with a sentence on how to go on; what was finished is in the store
    """
    progress = progress or Silent()
    wanted = {key: problem for key, problem in problems.items() if key not in store}
    progress.begin(len(problems), len(problems) - len(wanted))
    if not wanted:
        return
    own = LocalProcesses(workers)
    batch = _Batch(simulate, wanted, store, own if executor is None else executor, progress, names or {})
    try:
        failures = batch.run()
    except KeyboardInterrupt:
        with interrupts_ignored():
            batch.keep_finished()
            kept = sum(key in store for key in problems)
        raise KeyboardInterrupt(
            f"{kept} of {len(problems)} simulations are kept: give the same command again to go on from there"
        ) from None
    finally:
        batch.cancel()
        own.kill()
    if failures:
        raise SimulationError(failures, len(problems)) from next(iter(failures.values()))


class _Batch:
    """Simulations under way: which future belongs to which key, and who had a second try."""

    def __init__(
        self,
        simulate: Simulate,
        problems: Mapping[str, Problem],
        store: SolutionStore,
        executor: Executor,
        progress: Progress,
        names: Mapping[str, str],
    ) -> None:
        self.simulate, self.problems, self.store = simulate, problems, store
        self.executor, self.progress, self.names = executor, progress, names
        self.keys: dict[Future[Solution], str] = {}
        self.retried: set[str] = set()
        self.failures: dict[str, BaseException] = {}

    def run(self) -> dict[str, BaseException]:
        """Run everything; name → error of what failed."""
        for key in self.problems:
            self._submit(key)
        while self.keys:
            for future in wait(self.keys, return_when=FIRST_COMPLETED).done:
                self._settle(future, self.keys[future])
                del self.keys[future]
        return self.failures

    def keep_finished(self) -> None:
        """Put what is finished but not yet put."""
        for future, key in self.keys.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                self.store.put(key, future.result())

    def cancel(self) -> None:
        """Start nothing more."""
        for future in self.keys:
            future.cancel()

    def _submit(self, key: str) -> None:
        try:
            self.keys[self.executor.submit(self.simulate, self.problems[key])] = key
        except BrokenExecutor as error:
            self._fail(key, error)

    def _settle(self, future: Future[Solution], key: str) -> None:
        error = future.exception()
        if error is None:
            self.store.put(key, future.result())
            self.progress.done(self._name(key))
        elif isinstance(error, ProcessLostError | BrokenExecutor) and key not in self.retried:
            self.retried.add(key)
            self.progress.lost(self._name(key), error)
            self._submit(key)
        else:
            self._fail(key, error)

    def _fail(self, key: str, error: BaseException) -> None:
        self.failures[self._name(key)] = error
        self.progress.failed(self._name(key), error)

    def _name(self, key: str) -> str:
        return self.names.get(key, key)
