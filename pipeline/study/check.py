"""Whether a bundle is in order."""

from __future__ import annotations

from pathlib import Path

from pipeline.store.bundle import Bundle, read_bundle
from pipeline.study.assembly import read_phases, refuse_untold


def check(folder: Path) -> str:
    """Read everything in a bundle; says what it holds, refuses with every problem at once."""
    bundle = read_bundle(folder, thorough=True)
    refuse_untold(bundle)
    _, remarks = read_phases(bundle)
    return "\n".join(["The bundle is in order.", *_holds(bundle), *remarks])


def _holds(bundle: Bundle) -> list[str]:
    told = [f"{bundle.name}: {bundle.specimen.geometry}"]
    if bundle.curve is not None:
        cmod, load = bundle.curve.peak()
        told.append(f"load–CMOD: {bundle.curve.load.size} rows, peak {load:.0f} N at {cmod * 1e3:.3f} mm")
    if bundle.fields is not None:
        frames, points = bundle.fields.valid.shape
        told.append(f"fields: {points} points in {frames} frames, {bundle.fields.valid.mean():.1%} valid")
    if bundle.images:
        told.append(f"{len(bundle.images)} speckle images")
    return told
