"""load_cmod.csv: the clean record of a bundle."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.units import MM
from pipeline.store.atomic import write_atomically
from pipeline.store.tables import Table, not_increasing, read_table

FILE = "load_cmod.csv"
REQUIRED, OPTIONAL = ("time_s", "cmod_mm", "load_n"), ("load_line_mm",)
START_CMOD_MM, START_CMOD_SHARE = 0.005, 0.1  # either may remain after zeroing; the share is of the CMOD at peak
START_LOAD_SHARE = 0.5  # of the peak: a record that begins higher has lost its rise


def read_load_cmod(path: Path) -> tuple[LoadCurve | None, list[str]]:
    """The curve in SI, or None, and one sentence for each problem of the file.

    Times must increase; the record must begin near zero: |CMOD| at most 0.005 mm or a tenth of the CMOD
    at the peak, the load below half the peak.
    """
    table, problems = read_table(path, REQUIRED, OPTIONAL)
    if table is None:
        return None, problems
    problems = not_increasing(path.name, table, "time_s") + _shape_problems(path.name, table)
    return (None, problems) if problems else (_curve(table), [])


def write_load_cmod(path: Path, curve: LoadCurve) -> None:
    """Write a curve as load_cmod.csv, twelve digits a number."""
    write_atomically(path, encode_load_cmod(curve))


def encode_load_cmod(curve: LoadCurve) -> bytes:
    """The content of load_cmod.csv."""
    columns = [curve.time, curve.cmod / MM, curve.load]
    names = list(REQUIRED)
    if curve.load_line is not None:
        columns.append(curve.load_line / MM)
        names += OPTIONAL
    rows = (",".join(f"{value:.12g}" for value in row) for row in np.column_stack(columns).tolist())
    return ("\n".join([",".join(names), *rows]) + "\n").encode()


def _curve(table: Table) -> LoadCurve:
    columns = table.columns
    line = columns.get("load_line_mm")
    return LoadCurve(columns["time_s"], columns["cmod_mm"] * MM, columns["load_n"], None if line is None else line * MM)


def _shape_problems(file: str, table: Table) -> list[str]:
    """A record too short, without a positive peak, or without its beginning."""
    cmod, load = table.columns["cmod_mm"], table.columns["load_n"]
    if table.count < 3:
        return [f"{file}: has {table.count} rows, a curve needs at least 3"]
    peak = int(np.argmax(load))
    if load[peak] <= 0:
        return [f"{file}: load_n is nowhere positive: opening counts positive, turn its sign"]
    allowed = max(START_CMOD_MM, START_CMOD_SHARE * cmod[peak])
    first = table.line[0]
    problems = []
    if abs(cmod[0]) > allowed:
        problems.append(
            f"{file}: row {first}: the record begins at cmod_mm = {cmod[0]:g}, it must begin at zero "
            f"(within {allowed:.3g}): subtract the gauge's offset, or use `cohesive-bpm new DIR --from FILE`"
        )
    if load[0] > START_LOAD_SHARE * load[peak]:
        problems.append(
            f"{file}: row {first}: the record begins at load_n = {load[0]:g}, more than half its peak of "
            f"{load[peak]:g}: the rise is missing, start the record at zero load"
        )
    return problems
