"""Whether a bundle is in order."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pipeline.core.errors import BundleError, InputError, PipelineError
from pipeline.store.bundle import Bundle, inspect_bundle
from pipeline.study.assembly import read_phases, refuse_untold
from pipeline.study.prospects import shows_peak

T = TypeVar("T")


def check(folder: Path) -> str:
    """Read everything in a bundle; says what it holds, refuses with every problem at once."""
    bundle, problems = inspect_bundle(folder, thorough=True)
    remarks: tuple[str, ...] = ()
    if bundle is not None:
        _collect(problems, lambda: refuse_untold(bundle))
        _collect(problems, lambda: _refuse_blank_fields(bundle))
        _, remarks = _collect(problems, lambda: read_phases(bundle)) or (None, ())
    if bundle is None or problems:
        raise BundleError(problems)
    return "\n".join(["The bundle is in order.", *_holds(bundle), *remarks])


def _collect(problems: list[str], look: Callable[[], T]) -> T | None:
    """What `look` returns; where it refuses, its sentences join the problems unless they are told already."""
    try:
        return look()
    except PipelineError as error:
        problems += [line for line in str(error).splitlines() if not any(line in known for known in problems)]
        return None


def _refuse_blank_fields(bundle: Bundle) -> None:
    if bundle.fields is not None and not bundle.fields.valid.any():
        raise InputError("fields.h5: no point is valid in any frame: nothing can be compared; measure again")


def _holds(bundle: Bundle) -> list[str]:
    told = [f"{bundle.name}: {bundle.specimen.geometry}"]
    if bundle.curve is not None:
        cmod, load = bundle.curve.peak()
        told.append(f"load–CMOD: {bundle.curve.load.size} rows, peak {load:.0f} N at {cmod * 1e3:.3f} mm")
        if not shows_peak(bundle.curve):
            told.append("load–CMOD: the record ends at its peak: `identify` needs what follows it")
    if bundle.fields is not None:
        frames, points = bundle.fields.valid.shape
        told.append(f"fields: {points} points in {frames} frames, {bundle.fields.valid.mean():.1%} valid")
    if bundle.images:
        told.append(f"{len(bundle.images)} speckle images")
    return told
