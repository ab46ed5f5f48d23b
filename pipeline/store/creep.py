"""creep.csv: measured creep compliance of the mastic."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.errors import BundleError, MissingFileError
from pipeline.core.units import GPA
from pipeline.store.tables import Table, read_table

FILE = "creep.csv"
REQUIRED, OPTIONAL = ("time_s", "compliance_1_per_gpa"), ("temperature_c",)
LARGEST, SMALLEST = 1e4, 1e-4  # 1/GPa: moduli between 0.1 MPa and 10,000 GPa


@dataclass(frozen=True)
class CreepRecord:
    """Creep compliance of the mastic.

    Parameters
    ----------
    time : (n,) array, s, positive; increasing at each temperature
    compliance : (n,) array, 1/Pa
    temperature_c : (n,) array, °C, or None
    """

    time: np.ndarray
    compliance: np.ndarray
    temperature_c: np.ndarray | None = None


def read_creep(path: Path) -> CreepRecord:
    """The creep record of a CSV file; refuses with every problem at once."""
    if not path.is_file():
        raise MissingFileError(f"{path} does not exist")
    record, problems = parse_creep(path)
    if record is None:
        raise BundleError(problems)
    return record


def parse_creep(path: Path) -> tuple[CreepRecord | None, list[str]]:
    """The record in SI, or None, and one sentence for each problem of the file."""
    table, problems = read_table(path, REQUIRED, OPTIONAL)
    if table is None:
        return None, problems
    problems = _problems(path.name, table)
    if problems:
        return None, problems
    columns = table.columns
    return CreepRecord(columns["time_s"], columns["compliance_1_per_gpa"] / GPA, columns.get("temperature_c")), []


def encode_creep(record: CreepRecord) -> bytes:
    """The content of creep.csv, twelve digits a number."""
    columns = [record.time, record.compliance * GPA]
    names = list(REQUIRED)
    if record.temperature_c is not None:
        columns.append(record.temperature_c)
        names += OPTIONAL
    rows = (",".join(f"{value:.12g}" for value in row) for row in np.column_stack(columns).tolist())
    return ("\n".join([",".join(names), *rows]) + "\n").encode()


def _problems(file: str, table: Table) -> list[str]:
    time, compliance = table.columns["time_s"], table.columns["compliance_1_per_gpa"]
    same = np.diff(table.columns.get("temperature_c", np.zeros(table.count))) == 0
    rules = (
        (time <= 0, "time_s", time, "must be positive"),
        (np.append(False, same & (np.diff(time) <= 0)), "time_s", time, "must increase at one temperature"),
        (
            (compliance < SMALLEST) | (compliance > LARGEST),
            "compliance_1_per_gpa",
            compliance,
            f"lies outside {SMALLEST:g} to {LARGEST:g} 1/GPa: check the unit",
        ),
    )
    found = []
    for bad, name, values, rule in rules:
        if bad.any():
            at = int(np.argmax(bad))
            found.append(f"{file}: row {table.line[at]}: {name} = {values[at]:g} {rule}")
    return found
