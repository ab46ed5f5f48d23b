"""One call in a process of its own, for a worker elsewhere: `python -m pipeline.execution.serve FOLDER`.

The folder holds the call; what it returned, or the error it raised, is left there. The process ends with the one that
started it.
"""

from __future__ import annotations

import os
import pickle
import platform
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.core.errors import ToolchainError
from pipeline.execution.processes import THREADS, WorkerLostError, epitaph

CALL, ANSWER = "call", "answer"


def do_in_a_process(call: bytes, version: str = __version__) -> Any:
    """Do a pickled call in a fresh process, so that it may change its folder, use MPI, or crash.

    Raises
    ------
    ToolchainError
        where this package is not of the version that asks: its results would not be
    WorkerLostError
        where the process ended without an answer
    Exception
        what the call itself raised
    """
    if version != __version__:
        raise ToolchainError(
            f"the worker on {platform.node()} has version {__version__} of this package: install {version} there"
        )
    with tempfile.TemporaryDirectory(prefix="cohesive-bpm-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        (folder / CALL).write_bytes(call)
        paths = os.pathsep.join(path for path in sys.path if path)
        environment = os.environ | {"PYTHONPATH": paths, "TMPDIR": name} | dict.fromkeys(THREADS, "1")
        done = subprocess.run([sys.executable, "-m", __name__, name], env=environment, check=False)
        if not (folder / ANSWER).exists():
            raise WorkerLostError(epitaph(done.returncode))
        answer, error = pickle.loads((folder / ANSWER).read_bytes())
    if error is not None:
        raise error
    return answer


def main(folder: Path) -> None:
    """Do the call of a folder."""
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    answer: tuple[Any, BaseException | None]
    try:
        answer = pickle.loads((folder / CALL).read_bytes())(), None
    except Exception as error:  # whatever it is, whoever asked decides
        answer = None, error
    draft = folder / f"{ANSWER}.part"
    draft.write_bytes(pickle.dumps(answer))
    draft.rename(folder / ANSWER)


def _end_with(parent: int) -> None:
    """End this process as soon as the one that started it is gone."""
    while os.getppid() == parent:
        time.sleep(0.2)
    os._exit(1)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
