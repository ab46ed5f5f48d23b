"""The command in this process, or as a process of its own with a scratch folder that can be looked into."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from typer.testing import CliRunner, Result

from pipeline.cli import app


def run(*line: object) -> Result:
    """The command in this process."""
    return CliRunner().invoke(app, [str(word) for word in line], env={"COLUMNS": "200"})


def start(*line: object, scratch: Path, before: Callable[[], None] | None = None) -> subprocess.Popen[str]:
    """Start `cohesive-bpm LINE` in a process group of its own; temporary files go to `scratch`."""
    scratch.mkdir(exist_ok=True)
    paths = os.pathsep.join(path for path in sys.path if path)
    environment = os.environ | {"PYTHONPATH": paths, "TMPDIR": str(scratch), "COLUMNS": "200"}
    command = [sys.executable, "-m", "pipeline", *map(str, line)]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, env=environment, start_new_session=True, stdout=pipe, stderr=pipe, text=True, preexec_fn=before
    )


def wait_for(condition: Callable[[], object], seconds: float = 60.0) -> None:
    """Wait until the condition holds; TimeoutError if it never does."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("what was waited for did not happen")
        time.sleep(0.02)


def workers(pid: int) -> list[int]:
    """Processes that a process has spawned for its simulations."""
    found = []
    for tasks in Path(f"/proc/{pid}/task").glob("*/children"):
        found += [int(child) for child in _text(tasks).split()]
    return [child for child in found if "spawn_main" in _text(Path(f"/proc/{child}/cmdline"))]


def alive(pid: int) -> bool:
    """Whether a process runs (a zombie does not)."""
    state = _text(Path(f"/proc/{pid}/stat")).rpartition(")")[2].split()
    return bool(state) and state[0] != "Z"


def hears_interrupts(pid: int) -> bool:
    """Whether an interrupt would reach a process."""
    lines = (line.partition(":") for line in _text(Path(f"/proc/{pid}/status")).splitlines())
    masks = [int(value, 16) for name, _, value in lines if name in ("SigBlk", "SigIgn")]
    return not any(mask & 1 << signal.SIGINT - 1 for mask in masks)


def end_group(process: subprocess.Popen[str]) -> None:
    """End a started command and all it spawned, should a test have left it running."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode(errors="replace")
    except OSError:  # it has just ended
        return ""
