"""Stand-ins that a spawned process can import: a simulation that misbehaves on request, a store, a command.

Run as a command (`python -m execution.fake_engine FOLDER COUNT SECONDS`) it is a long run that tests can kill.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_info

from pipeline.core.errors import ConvergenceError
from pipeline.execution.simulations import run_all


@dataclass(frozen=True)
class Task:
    """What stands for a Problem; every attempt leaves a file NUMBER.PID in `folder`."""

    number: int
    folder: Path
    seconds: float = 0.0
    act: str = ""
    partner: int | None = None

    def attempts(self) -> list[int]:
        """Process numbers of all attempts, in any order."""
        return [int(path.suffix[1:]) for path in self.folder.glob(f"{self.number}.*")]


def answer(number: int) -> np.ndarray:
    """What simulating the task of this number returns."""
    return np.cumsum(np.random.default_rng(number).normal(size=500))


def simulate(task: Task) -> np.ndarray:
    """Do as the task says."""
    first = not task.attempts()
    (task.folder / f"{task.number}.{os.getpid()}").touch()
    if task.act == "raise":
        raise ConvergenceError(f"task {task.number} did not converge")
    if task.act == "die" or (task.act == "die once" and first):
        os.kill(os.getpid(), signal.SIGKILL)
    if task.partner is not None:
        meet(lambda: Task(task.partner or 0, task.folder).attempts())
    time.sleep(task.seconds)
    return answer(task.number)


def threads_of_linear_algebra(_: Task) -> np.ndarray:
    """Numbers of threads that linear algebra uses in this process, after NumPy and SciPy are there."""
    import scipy.linalg  # noqa: F401

    return np.array([library["num_threads"] for library in threadpool_info()])


def meet(condition: Callable[[], object], seconds: float = 20.0) -> None:
    """Wait until the condition holds; TimeoutError if it never does."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("what was waited for did not happen")
        time.sleep(0.02)


class FolderStore:
    """One file a key, written under another name first."""

    def __init__(self, folder: Path):
        self.folder = folder

    def __contains__(self, key: str) -> bool:
        return (self.folder / f"{key}.npy").is_file()

    def __iter__(self) -> Iterator[str]:
        return (path.stem for path in sorted(self.folder.glob("*.npy")))

    def put(self, key: str, solution: np.ndarray) -> None:
        """Write `solution` under `key`."""
        draft = self.folder / f"{key}.draft"
        with draft.open("wb") as file:
            np.save(file, solution)
        draft.rename(self.folder / f"{key}.npy")

    def get(self, key: str) -> np.ndarray:
        """Read what was put under `key`."""
        return np.load(self.folder / f"{key}.npy")


def command(folder: Path, count: int, seconds: float) -> int:
    """Run `count` tasks into a FolderStore on two workers; 130 after an interrupt, as the face does."""
    tasks = {f"key{n}": Task(n, folder, seconds) for n in range(count)}
    try:
        run_all(simulate, tasks, FolderStore(folder), workers=2)  # type: ignore[arg-type]
    except KeyboardInterrupt as stop:
        print(stop)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(command(Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
