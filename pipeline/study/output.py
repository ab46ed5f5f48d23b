"""The folder of a command's results: whose it is, and what must not be written over."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.store import frames
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import Bundle
from pipeline.store.experiment import FILE
from pipeline.store.results import prepare_output, read_result

TRUTH, UNFINISHED = "truth.json", "unfinished-virtual-test.txt"  # mark the bundle of a virtual test


def results_folder(out: Path, bundle: Bundle) -> Path:
    """Make OUT for the results of a bundle, which result.json calls by name under `bundle`.

    Simulations of several bundles may lie in one OUT, each is found by what was simulated; results may not.

    Raises
    ------
    InputError
        where OUT is a bundle, lies among the images of this one, or holds the results of another
    StoreError
        where it cannot be written
    """
    out = Path(out)
    if (out / FILE).exists():
        raise InputError(f"{out} is a bundle: results get a folder of their own, choose another -o")
    images = (bundle.folder / frames.FOLDER).resolve()
    if images in (out.resolve(), *out.resolve().parents):
        raise InputError(f"{out} is for the speckle images of {bundle.folder}: choose another -o")
    owner = _owner(out)
    if owner not in (None, bundle.name):
        raise InputError(
            f"{out} holds the results of bundle {owner!r}, they would be lost: choose another -o for {bundle.name!r}"
        )
    return prepare_output(out)


def joint_folder(out: Path, names: list[str]) -> Path:
    """Make OUT for what several bundles say together; result.json names them under `bundle`.

    Raises
    ------
    InputError
        where OUT is a bundle, or holds the results of other bundles
    StoreError
        where it cannot be written
    """
    out, joint = Path(out), joined(names)
    if (out / FILE).exists():
        raise InputError(f"{out} is a bundle: results get a folder of their own, choose another -o")
    owner = _owner(out)
    if owner not in (None, joint):
        raise InputError(f"{out} holds the results of {owner!r}, they would be lost: choose another -o for {joint!r}")
    return prepare_output(out)


def joined(names: list[str]) -> str:
    """What result.json calls several bundles together, in whatever order they are given."""
    return " + ".join(sorted(names))


@contextmanager
def virtual_test_folder(out: Path) -> Iterator[None]:
    """Let a virtual test be made in OUT; one that was stopped may be made again there, a measured one stays.

    Raises
    ------
    InputError
        where a bundle lies that no virtual test left there
    StoreError
        where OUT cannot be written
    """
    out, mark = Path(out), Path(out) / UNFINISHED
    if (out / FILE).exists() and not (out / TRUTH).exists() and not mark.exists():
        raise InputError(f"{out} holds a bundle that is no virtual test (no {TRUTH}): choose another folder")
    prepare_output(out)
    write_atomically(mark, b"a virtual test that was not finished: the same command makes it again\n")
    done = False
    try:
        yield
        done = True
    finally:
        if done or not (out / FILE).exists():  # finished, or refused before anything was written
            mark.unlink(missing_ok=True)
            with suppress(OSError):  # it holds something
                out.rmdir()


def plain_folder(out: Path, command: str) -> Path:
    """Make OUT for results that belong to no bundle, refuse one that holds a bundle or another command's results.

    Raises
    ------
    InputError, StoreError
        naming the folder and what to do
    """
    out = Path(out)
    if (out / FILE).exists():
        raise InputError(f"{out} is a bundle: results get a folder of their own, choose another -o")
    try:
        other = read_result(out).get("command")
    except (MissingFileError, StoreError, OSError, AttributeError):
        other = None
    if other not in (None, command):
        raise InputError(f"{out} holds results of the command {other}, they would be lost: choose another -o")
    return prepare_output(out)


def _owner(out: Path) -> str | None:
    """The bundle whose results lie in a folder, None where there are none or nobody can tell."""
    try:
        found = read_result(out)
    except (MissingFileError, StoreError, OSError):
        return None
    name = found.get("bundle") if isinstance(found, dict) else None
    return name if isinstance(name, str) else None
