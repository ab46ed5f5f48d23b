"""What a command shows while it runs, and how it ends: one message and an exit code."""

from __future__ import annotations

import errno
import os
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import TracebackType

import typer

from pipeline.core.errors import PipelineError

REMEDY = {
    errno.ENOSPC: "the disk is full; make room and give the same command again",
    errno.EDQUOT: "your share of the disk is used up; make room and give the same command again",
    errno.EFBIG: "the file would exceed the size allowed here (see ulimit -f); raise the limit",
    errno.EACCES: "there is no permission; choose another folder, or change its permissions",
    errno.EPERM: "there is no permission; choose another folder, or change its permissions",
    errno.EROFS: "it lies on a file system that cannot be written; choose another folder",
}


@contextmanager
def exit_codes(debug: bool) -> Iterator[None]:
    """Turn an error into one message on stderr and an exit code: 1, or 130 after an interrupt."""
    try:
        with warnings.catch_warnings():
            if not debug:
                warnings.simplefilter("ignore")  # they speak to programmers; what a user must know is an error
            yield
    except BrokenPipeError:  # whoever read the output has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what is still to be flushed
        raise typer.Exit(1) from None
    except KeyboardInterrupt as stop:
        _end(stop, f"stopped; {str(stop) or 'give the same command again to go on'}", 130, debug)
    except PipelineError as error:
        _end(error, str(error), 1, debug)
    except OSError as error:
        _end(error, _about_file(error), 1, debug)
    except MemoryError as error:
        _end(error, "there is not enough memory: take a larger particle radius or fewer --workers", 1, debug)
    except Exception as error:
        told = f"{type(error).__name__}: {error}; this is a fault of the program: please report it with --debug"
        _end(error, told, 1, debug)


def finish(summary: str | None, place: Path) -> None:
    """Print what a command found and where the result lies."""
    if summary:
        print(summary)
    print(f"result: {place}", flush=True)


def _end(error: BaseException, message: str, code: int, debug: bool) -> None:
    if debug:
        traceback.print_exception(error)
    print(f"cohesive-bpm: {message}", file=sys.stderr)
    raise typer.Exit(code) from None


def _about_file(error: OSError) -> str:
    """File, reason and remedy of an error of the operating system."""
    what = str(error.filename or "standard output, or a file without a name")
    reason = REMEDY.get(error.errno or 0)
    return f"{what}: {reason or error.strerror or error}"


class Display(AbstractContextManager["Display"]):
    """Progress on stderr: a bar with the remaining time on a terminal, a line a simulation elsewhere."""

    def __init__(self) -> None:
        self._bar = _Bar() if sys.stderr.isatty() else _Lines()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.close()

    def stage(self, name: str) -> None:
        """Name the next stage."""
        self._bar.say(name)

    def begin(self, total: int, kept: int, what: str = "simulation") -> None:
        """Start counting simulations, or what else there is."""
        if kept:
            self._bar.say(f"{kept} of {total} {what}s are kept from an earlier run")
        self._bar.begin(total, kept, what)

    def done(self, key: str) -> None:
        """Count one."""
        self._bar.advance()

    def lost(self, key: str, error: BaseException) -> None:
        """Say that a simulation is tried again."""
        self._bar.say(f"{key}: {error}; it is tried once more")

    def failed(self, key: str, error: BaseException) -> None:
        """Say that a simulation failed, and count it."""
        if self._bar.total > 1:  # the only one is the error that ends the command
            self._bar.say(f"{key} failed: {error}")
            self._bar.advance()


class _Lines:
    """Progress for a file: a line a simulation."""

    def begin(self, total: int, kept: int, what: str) -> None:
        self.total, self._kept, self._count, self._what = total, kept, kept, what
        self._start = time.monotonic()

    def advance(self) -> None:
        self._count += 1
        each = (time.monotonic() - self._start) / (self._count - self._kept)
        left = each * (self.total - self._count)
        self.say(f"{self._what} {self._count} of {self.total}" + (f", about {_clock(left)} left" if left else ""))

    def say(self, text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def close(self) -> None:
        pass


class _Bar(_Lines):
    """Progress for a terminal."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._progress = Progress(
            *(TextColumn(c) if isinstance(c, str) else c for c in columns),
            TextColumn("{task.fields[left]}"),
            console=Console(stderr=True, highlight=False),
        )
        self._progress.start()

    def begin(self, total: int, kept: int, what: str) -> None:
        super().begin(total, kept, what)
        self._task = self._progress.add_task(f"{what}s", total=total, completed=kept, left="")

    def advance(self) -> None:
        self._count += 1
        each = (time.monotonic() - self._start) / (self._count - self._kept)
        left = _clock(each * (self.total - self._count))
        self._progress.update(self._task, completed=self._count, left=f"about {left} left")

    def say(self, text: str) -> None:
        self._progress.console.print(text, markup=False)

    def close(self) -> None:
        self._progress.stop()


def _clock(seconds: float) -> str:
    """A time as a person says it."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
