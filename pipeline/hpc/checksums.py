"""SHA-256 of files, and lists of them that `sha256sum -c` reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path


def sha256(path: Path) -> str:
    """The digest of a file, 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def checksums(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Name → digest of files in a folder, sorted by name."""
    return {name: sha256(folder / name) for name in sorted(names)}


def checksum_list(digests: dict[str, str], title: str) -> str:
    """Digests as `sha256sum -c` reads them, below a comment."""
    return "".join([f"# {title}\n", *(f"{digest}  {name}\n" for name, digest in digests.items())])


def read_checksum_list(text: str) -> dict[str, str]:
    """Name → digest of such a list; lines of another form are left out."""
    rows = (line.split("  ", 1) for line in text.splitlines() if not line.startswith("#"))
    return {row[1]: row[0] for row in rows if len(row) == 2}


def changed(folder: Path, digests: dict[str, str]) -> list[str]:
    """Files of a folder that are missing, as "NAME is missing", or differ, as "NAME has another checksum"."""
    found = []
    for name, digest in digests.items():
        if not (folder / name).is_file():
            found.append(f"{name} is missing")
        elif sha256(folder / name) != digest:
            found.append(f"{name} has another checksum than when it was written")
    return found
