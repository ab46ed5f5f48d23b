"""The plain CSV tables of a bundle: strict columns, every faulty row named."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SHOWN = 3  # faulty rows named one by one before the rest is counted


@dataclass(frozen=True)
class Table:
    """Columns of numbers by name, and the line of the file that each row came from."""

    columns: dict[str, np.ndarray]
    line: np.ndarray

    @property
    def count(self) -> int:
        return self.line.size


def read_table(path: Path, required: tuple[str, ...], optional: tuple[str, ...] = ()) -> tuple[Table | None, list[str]]:
    """A CSV table with a header of exactly these names, and one sentence for each problem.

    Returns
    -------
    Table, or None where a problem makes its numbers useless; list of sentences
    """
    rows, problems = _rows(path)
    if problems:
        return None, problems
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    problems = _header_problems(path.name, header, required, optional)
    if problems:
        return None, problems
    faults, values = [], []
    for line, cells in rows[1:]:
        numbers, fault = _numbers(header, cells)
        faults += [f"row {line}: {fault}"] if fault else []
        values.append(numbers)
    if not values:
        return None, [f"{path.name}: has no rows below its header: add the measured values"]
    if faults:
        return None, [f"{path.name}: {fault}" for fault in shortened(faults)]
    columns = dict(zip(header, np.array(values).T, strict=True))
    return Table(columns, np.array([line for line, _ in rows[1:]])), []


def _rows(path: Path) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """Line number and cells of every line that is not blank."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        return [], [f"{path.name}: cannot be read ({error.strerror})"]
    except UnicodeDecodeError as error:
        return [], [f"{path.name}: is not UTF-8 text (byte {error.start}): export it again as plain CSV"]
    lines = enumerate(text.splitlines(), start=1)
    return [(number, next(csv.reader([line]))) for number, line in lines if line.strip()], []


def _header_problems(file: str, header: list[str], required: tuple[str, ...], optional: tuple[str, ...]) -> list[str]:
    """What is wrong with the first line."""
    wanted = ",".join(required) + "".join(f"[,{name}]" for name in optional)
    missing = [name for name in required if name not in header]
    unknown = [name for name in header if name not in (*required, *optional)]
    if not missing and not unknown and len(set(header)) == len(header):
        return []
    shown = ",".join(header)[:80]
    return [
        f"{file}: row 1 is '{shown}', the header must be {wanted}: rename the columns"
        + (", or read the machine's own file with `cohesive-bpm new DIR --from FILE`" if "load_n" in required else "")
    ]


def _numbers(header: list[str], cells: list[str]) -> tuple[list[float], str]:
    """The finite numbers of one row, or what is wrong with it."""
    if len(cells) != len(header):
        return [], f"has {len(cells)} cells, the header has {len(header)}"
    numbers = []
    for name, cell in zip(header, cells, strict=True):
        try:
            numbers.append(float(cell))
        except ValueError:
            return [], f"{name} = '{cell.strip()}' is not a number"
        if not np.isfinite(numbers[-1]):
            return [], f"{name} is {cell.strip()}: remove the row or fill in the value"
    return numbers, ""


def shortened(faults: list[str], noun: str = "rows") -> list[str]:
    """The first faults, and how many more there are."""
    rest = len(faults) - SHOWN
    return faults if rest <= 0 else [*faults[:SHOWN], f"{rest} more {noun} have such faults"]


def not_increasing(file: str, table: Table, name: str) -> list[str]:
    """One sentence where a column does not increase from row to row."""
    values = table.columns[name]
    bad = np.flatnonzero(np.diff(values) <= 0)
    if not bad.size:
        return []
    at = int(bad[0]) + 1
    more = f" (and in {bad.size - 1} more rows)" if bad.size > 1 else ""
    return [
        f"{file}: row {table.line[at]}: {name} = {values[at]:g} must be larger than {values[at - 1]:g} in the row "
        f"before{more}: times must increase"
    ]
