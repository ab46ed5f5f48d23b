"""The folder of a command's results: whose it is, and what must not be written over."""

from __future__ import annotations

from pathlib import Path

from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.store import frames
from pipeline.store.bundle import Bundle
from pipeline.store.experiment import FILE
from pipeline.store.results import prepare_output, read_result

TRUTH = "truth.json"  # marks the bundle of a virtual test


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


def refuse_measured_bundle(out: Path) -> None:
    """Refuse to make a virtual test where a bundle lies that no virtual test left there."""
    if (out / FILE).exists() and not (out / TRUTH).exists():
        raise InputError(
            f"{out} holds a bundle, and no {TRUTH} of a finished virtual test: choose another folder, or delete it"
        )


def _owner(out: Path) -> str | None:
    """The bundle whose results lie in a folder, None where there are none or nobody can tell."""
    try:
        found = read_result(out)
    except (MissingFileError, StoreError, OSError):
        return None
    name = found.get("bundle") if isinstance(found, dict) else None
    return name if isinstance(name, str) else None
