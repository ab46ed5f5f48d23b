"""The commands `library …`: identified mixtures kept, listed, exported, used as a start."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pipeline.core.errors import InputError
from pipeline.core.units import MM
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.experiment import FILE
from pipeline.store.library import UNKNOWN, Filter, Library, LibraryEntry
from pipeline.store.results import read_result

NEEDED = ("geometry", "thickness_mm", "bond_area_mm2", "f_max_n", "delta_max_m", "bond_fracture_energy_j_per_m2")


def add(library: Path, results: Sequence[Path], mixture: str, note: str = "", *, anyway: bool = False) -> str:
    """Keep the results of `identify` under the name of a mixture.

    Parameters
    ----------
    library : file; made if it does not exist
    results : folders with the result.json of an identification
    mixture : str; the same for all specimens of one mixture
    note : str
    anyway : bool; keep also a result that failed its own checks

    Raises
    ------
    InputError, MissingFileError, StoreError
        before anything is kept, where one of the results cannot be
    """
    if not mixture.strip():
        raise InputError("a mixture needs a name: --mixture NAME")
    entries = [entry_of(read_result(Path(folder)), Path(folder), mixture.strip(), note, anyway) for folder in results]
    kept = Library(library).add(*entries)
    return "\n".join(f"{entry.key}: {entry.bundle} of {entry.mixture}, {_estimate(entry)}" for entry in kept)


def entry_of(result: dict[str, Any], folder: Path, mixture: str, note: str, anyway: bool) -> LibraryEntry:
    """A row of the library from a result.json; refuses what is no identification, or none to rely on."""
    if not isinstance(result, dict) or result.get("command") != "identify":
        raise InputError(f"{folder} holds no result of `identify`: the library keeps identified mixtures")
    missing = [key for key in NEEDED if result.get(key) is None]
    if missing:
        raise InputError(
            f"{folder}/result.json has no {', '.join(missing)}: give the `identify` command again with the same -o, "
            "its simulations are kept"
        )
    if not result.get("accepted") and not anyway:
        raise InputError(
            f"{folder}: the estimate was not accepted ({result.get('status', 'no reason given')}): identify again with "
            "another grid, or keep it all the same with --anyway"
        )
    interval = result.get("interval_95") or {}
    spread = result.get("covariance") or [[math.nan] * 2] * 2
    return LibraryEntry(
        mixture=mixture,
        bundle=str(result["bundle"]),
        geometry=str(result["geometry"]),
        temperature_c=_number(result.get("temperature_c")),
        thickness_mm=float(result["thickness_mm"]),
        bond_area_mm2=float(result["bond_area_mm2"]),
        cmod_rate_mm_per_min=_number(result.get("cmod_rate_mm_per_min")),
        f_max_n=float(result["f_max_n"]),
        delta_max_m=float(result["delta_max_m"]),
        f_max_95_n=_pair(interval.get("f_max_n")),
        delta_max_95_m=_pair(interval.get("delta_max_m")),
        variance_f_max=_number(spread[0][0]),
        covariance=_number(spread[0][1]),
        variance_delta_max=_number(spread[1][1]),
        energy_j_per_m2=float(result["bond_fracture_energy_j_per_m2"]),
        energy_95_j_per_m2=_pair(result.get("interval_95_bond_fracture_energy_j_per_m2")),
        peak_load_n=_number(result.get("peak_load_n")),
        cmod_at_peak_mm=_number(result.get("cmod_at_peak_mm")),
        peak_load_mismatch=_number(result.get("peak_load_mismatch")),
        engine=str(result.get("engine", "")),
        objective=str(result.get("objective", "")),
        version=str(result.get("version", "")),
        accepted=bool(result.get("accepted")),
        source=str(folder.resolve()),
        added=datetime.now(UTC).isoformat(timespec="seconds"),
        note=note,
    )


def show(library: Path, wanted: Filter) -> str:
    """The entries that are meant, as a table."""
    rows = [_row(entry) for entry in Library(library).entries(wanted)]
    if not rows:
        return f"{library} holds no such entry"
    table = [HEADER, *rows]
    widths = [max(len(row[k]) for row in table) for k in range(len(HEADER))]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in table)


def export(library: Path, file: Path, wanted: Filter) -> str:
    """Write the entries that are meant as a CSV table, units in the names of its columns."""
    entries = Library(library).entries(wanted)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    names = [field.name for field in fields(LibraryEntry)]
    writer.writerow([*(title for name in names for title in _titles(name)), "traction_mpa", "strength_mpa"])
    for entry in entries:
        cells = [cell for name in names for cell in _cells(getattr(entry, name))]
        writer.writerow([*cells, _cell(entry.traction_mpa), _cell(entry.strength_mpa)])
    write_atomically(Path(file), stream.getvalue().encode())
    return f"{len(entries)} entries"


def remove(library: Path, key: str) -> str:
    """Take one entry out."""
    gone = Library(library).remove(key)
    return f"{gone.key} removed: {gone.bundle} of {gone.mixture}, {_estimate(gone)}"


def start(library: Path, bundle: Path, wanted: Filter) -> str:
    """Write [start] of a bundle from the nearest entry: the same mixture at the nearest temperature.

    f_max/(2 r t) and delta_max are taken over, so another radius or thickness is allowed for. Of entries
    equally near in temperature the one of the same geometry counts, then the one added last. Everything else
    in experiment.toml stays as it is, comments too.

    Raises
    ------
    InputError
        where the library holds several mixtures and none is named, or none that fits
    """
    test = read_bundle(bundle)
    entries = Library(library).entries(wanted)
    if not entries:
        raise InputError(f"{library} holds no such entry: `cohesive-bpm library list` shows what it holds")
    mixtures = sorted({entry.mixture for entry in entries})
    if len(mixtures) > 1:
        raise InputError(f"{library} holds several mixtures: name one with --mixture ({', '.join(mixtures)})")
    chosen = nearest(entries, test)
    area = 2 * test.model.radius * test.specimen.thickness / MM**2
    f_max, delta_max = chosen.traction_mpa * area, chosen.delta_max_m
    at = [] if math.isnan(chosen.temperature_c) else [f"{chosen.temperature_c:g} °C"]
    path = Path(bundle) / FILE
    write_atomically(path, with_start(path.read_text("utf-8-sig"), f_max, delta_max, chosen).encode())
    read_bundle(bundle)  # what was written is read as everything else is
    return (
        f"[start] of {test.name}: f_max_n = {f_max:.4g}, delta_max_m = {delta_max:.4g}, from {chosen.key} "
        f"({', '.join([chosen.bundle, chosen.geometry, *at])})"
    )


def nearest(entries: Sequence[LibraryEntry], test: Bundle) -> LibraryEntry:
    """The entry nearest in temperature, then of the same geometry, then added last."""
    wanted = test.loading.temperature_c

    def distance(pair: tuple[int, LibraryEntry]) -> tuple[float, bool, int]:
        place, entry = pair
        known = wanted is not None and math.isfinite(entry.temperature_c)
        away = abs(entry.temperature_c - wanted) if known and wanted is not None else math.inf
        return away, entry.geometry != test.specimen.geometry, -place

    return min(enumerate(entries), key=distance)[1]


def with_start(text: str, f_max: float, delta_max: float, source: LibraryEntry) -> str:
    """The text of experiment.toml with other numbers in [start], the table added where there is none."""
    text = text if text.endswith("\n") else text + "\n"
    remark = f"  # {source.key} of the library: {source.bundle}"
    lines = {"f_max_n": f"f_max_n = {f_max:.6g}{remark}", "delta_max_m": f"delta_max_m = {delta_max:.6g}{remark}"}
    table = re.search(r"^[ \t]*\[[ \t]*start[ \t]*\][^\n]*\n((?:(?![ \t]*\[).*\n?)*)", text, re.MULTILINE)
    if table is None:
        return text.rstrip("\n") + "\n\n[start]\n" + "\n".join(lines.values()) + "\n"
    body = table[1]
    for key, line in lines.items():
        body, count = re.subn(rf"^[ \t]*{key}[ \t]*=[^\n]*$", line, body, count=1, flags=re.MULTILINE)
        body = body if count else line + "\n" + body
    return text[: table.start(1)] + body + text[table.end(1) :]


HEADER = [
    "key",
    "mixture",
    "test",
    "geometry",
    "°C",
    "f_max (N)",
    "95 %",
    "delta_max (mm)",
    "95 %",
    "MPa",
    "J/m²",
    "load",
    "",
]


def _row(entry: LibraryEntry) -> list[str]:
    low, high = entry.f_max_95_n
    least, most = entry.delta_max_95_m
    return [
        entry.key,
        entry.mixture,
        entry.bundle,
        entry.geometry,
        "" if math.isnan(entry.temperature_c) else f"{entry.temperature_c:g}",
        f"{entry.f_max_n:.4g}",
        "" if math.isnan(low) else f"{low:.4g}–{high:.4g}",
        f"{entry.delta_max_m / MM:.4g}",
        "" if math.isnan(least) else f"{least / MM:.4g}–{most / MM:.4g}",
        f"{entry.traction_mpa:.3g}",
        f"{entry.energy_j_per_m2:.0f}",
        "" if math.isnan(entry.peak_load_mismatch) else f"{entry.peak_load_mismatch:+.0%}",
        entry.note if entry.accepted else f"not accepted {entry.note}".strip(),
    ]


def _estimate(entry: LibraryEntry) -> str:
    return f"f_max = {entry.f_max_n:.4g} N, delta_max = {entry.delta_max_m:.4g} m"


def _titles(name: str) -> tuple[str, ...]:
    return (name.replace("_95_", "_low_"), name.replace("_95_", "_high_")) if "_95_" in name else (name,)


def _cells(value: Any) -> tuple[str, ...]:
    return tuple(_cell(part) for part in value) if isinstance(value, tuple) else (_cell(value),)


def _cell(value: Any) -> str:
    """A number with nine digits, empty where unknown; text as it is."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.9g}"
    return str(value)


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _pair(value: Any) -> tuple[float, float]:
    return UNKNOWN if value is None else (_number(value[0]), _number(value[1]))
