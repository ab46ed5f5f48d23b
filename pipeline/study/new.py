"""A bundle to fill in."""

from __future__ import annotations

from pathlib import Path

from pipeline.core.units import MINUTE, MM
from pipeline.store.new import new_bundle
from pipeline.store.records import read_record


def new(folder: Path, geometry: str, record: Path | None = None, cmod_rate_mm_per_min: float | None = None) -> str:
    """Make a bundle, from a machine's record if one is given; says what was done."""
    rate = None if cmod_rate_mm_per_min is None else cmod_rate_mm_per_min * MM / MINUTE
    found = None if record is None else read_record(record, cmod_rate=rate)
    return "\n".join(new_bundle(folder, geometry, found, rate))
