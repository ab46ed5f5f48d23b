"""Files that are either whole or not there: written under another name, synced, renamed."""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections.abc import Iterator
from pathlib import Path

from pipeline.core.errors import StoreError

_REMEDY = {
    errno.ENOSPC: "the disk is full: free some space, then call the same command again, it goes on where it stopped",
    errno.EDQUOT: "the disk quota is used up: free some space, then call the same command again",
    errno.EFBIG: "the file would be larger than this system allows (ulimit -f): raise the limit or write elsewhere",
    errno.EROFS: "the file system is read-only: choose another output folder",
    errno.EACCES: "permission is denied: choose another output folder or change its rights",
    errno.EPERM: "permission is denied: choose another output folder or change its rights",
    errno.ENOENT: "the folder does not exist: create it or choose another output folder",
    errno.ENOTDIR: "a file stands where a folder is needed: choose another output folder",
    errno.EISDIR: "a folder stands where the file is to be written: move it away",
    errno.EEXIST: "a file stands where a folder is needed: choose another output folder",
}
SUFFIX = ".part"


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees all of it or nothing, also after a crash or a full disk.

    Raises
    ------
    StoreError
        naming the file and what to do; nothing of the new file is left, an earlier one stands untouched
    """
    part = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}{SUFFIX}")
    try:
        _write_synced(part, content)
        os.replace(part, path)
        _sync(path.parent)
    except OSError as error:
        raise refused(path, error) from error
    finally:
        with contextlib.suppress(OSError):  # no such folder, or read-only: then it was never made
            part.unlink(missing_ok=True)


@contextlib.contextmanager
def written_aside(path: Path) -> Iterator[Path]:
    """A name to write a large file under, which gets its own name when it is complete.

    Raises
    ------
    StoreError
        naming the file and what to do; nothing of the new file is left, an earlier one stands untouched
    """
    part = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}{SUFFIX}")
    try:
        yield part
        _sync(part)
        os.replace(part, path)
        _sync(path.parent)
    except StoreError:
        raise
    except OSError as error:
        raise refused(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def refused(path: Path, error: OSError) -> StoreError:
    """The error for a file that cannot be written: which one, why, what to do."""
    remedy = _REMEDY.get(error.errno or 0, f"{error.strerror}: check the output folder")
    return StoreError(f"{path} cannot be written: {remedy}")


def _write_synced(path: Path, content: bytes) -> None:
    with open(path, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _sync(path: Path) -> None:
    """Make a file, or the names in a folder, durable."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
