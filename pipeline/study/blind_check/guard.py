"""The process in which a sealed bundle is diagnosed: it opens no path outside OUT but those of its own program.

Started as `python -m pipeline.study.blind_check.guard OUT BUNDLES RESULTS SEED WITHOUT MODULE:FUNCTION`.
"""

from __future__ import annotations

import importlib
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

SYSTEM = ("/usr", "/lib", "/lib64", "/bin", "/etc", "/proc", "/sys", "/dev")
WATCH = 0.5  # s
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class Guard:
    """Refuses what is opened outside OUT.

    Read and run may be: the interpreter, its libraries, the program itself and the system's own files; the vault never.
    """

    def __init__(self, out: Path):
        self.out = str(out)
        self.vault = self.out + ".vault"
        program = [sys.prefix, sys.base_prefix, str(Path(__file__).resolve().parents[3]), *filter(None, sys.path)]
        self.program = tuple(dict.fromkeys(os.path.realpath(p) for p in program)) + SYSTEM

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event not in ("open", "os.listdir", "os.scandir") or not isinstance(arguments[0], str | bytes | os.PathLike):
            return
        path = os.path.realpath(os.fsdecode(arguments[0]))
        writes = event == "open" and bool((arguments[2] or 0) & WRITING)
        if not self.allowed(path, writes):
            raise PermissionError(f"a blind diagnosis must not open {path}: it lies outside {self.out}")

    def allowed(self, path: str, writes: bool) -> bool:
        """Whether a real path may be opened."""
        if _below(path, self.vault):
            return False
        if _below(path, self.out) or path.startswith("/dev/"):
            return True
        return not writes and any(_below(path, place) for place in self.program)


def _below(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder.rstrip("/") + "/")


def main(arguments: list[str]) -> None:
    """Diagnose a bundle, or several together, under guard."""
    out, bundles, results, seed, without, target = arguments
    module, function = target.split(":")
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    sys.addaudithook(Guard(Path(out).resolve()))
    diagnose = getattr(importlib.import_module(module), function)
    names = tuple(n for n in without.split(",") if n)
    diagnose([Path(b) for b in bundles.split(os.pathsep)], Path(results), without=names, seed=int(seed), workers=1)


def _end_with(parent: int) -> None:
    """End when the process that started this one is gone: a run that goes on must not meet it."""
    while os.getppid() == parent:
        time.sleep(WATCH)
    os._exit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
