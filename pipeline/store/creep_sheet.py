"""A laboratory's creep record: columns found by their titles, units taken from them, one or several temperatures."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.units import GPA, MPA
from pipeline.store.channels import SYNONYMS, TIME, normalised
from pipeline.store.creep import LARGEST, SMALLEST, CreepRecord
from pipeline.store.dialect import Block, read_block

PRESSURE = {"gpa": GPA, "mpa": MPA, "kpa": 1e3, "pa": 1.0, "psi": 6894.757293168, "ksi": 6894757.293168}
DEGREES: dict[str, Callable[[Any], Any]] = {  # of numbers and of arrays
    "c": lambda t: t,
    "k": lambda t: t - 273.15,
    "f": lambda t: (t - 32) / 1.8,
}
_UNIT = r"(gpa|mpa|kpa|pa|ksi|psi)"
_PER = re.compile(rf"(?<![a-z0-9])(?:1\s*(?:/|_?per_?|\s)\s*|per[\s_]*|/\s*){_UNIT}(?![a-z])|{_UNIT}\s*\^?\s*[-−]\s*1")
_DEGREES = re.compile(
    r"(?P<sign>[-−–]|minus\s*|m(?=\d)|)(?P<value>\d+(?:[.,]\d+)?)\s*_?(?:°|º|deg)?\s*(?P<unit>[cfk])(?![a-z])"
)
_TIME = re.compile(rf"\b({'|'.join(map(re.escape, SYNONYMS['time']))})\b")
WANTED = (
    "a creep record needs a column of times and one or more of compliance, with units in their titles, as in "
    "time_s,compliance_1_per_gpa[,temperature_c] or in 'Time (s)', 'D at -12 °C (1/GPa)', …"
)


@dataclass(frozen=True)
class _Column:
    """One column: "time", "temperature" or "compliance", its factor or unit, and the temperature in its title."""

    role: str
    index: int
    title: str
    factor: float = 1.0
    degrees: str = "c"
    temperature: float | None = None


def read_creep_sheet(path: Path) -> tuple[CreepRecord, tuple[str, ...]]:
    """The record of a text file in whatever dialect, and what was done to it, in sentences.

    Times stand in one column; compliances in one, beside a column of temperatures or none, or in several,
    each with its temperature in the title. Rows may repeat times (replicates) and stand in any order; empty
    cells and times that are not above zero are left out.

    Raises
    ------
    MissingFileError, InputError
        naming the file, the row or column, the rule and the remedy
    """
    if Path(path).is_dir():
        raise InputError(f"{path} is a folder: give the creep record itself, as in {path}/creep.csv")
    block = read_block(Path(path))
    name = Path(path).name
    columns = _columns(block, name)
    time, temperature, compliances = _roles(columns, name)
    parts = [_readings(block, time, temperature, column) for column in compliances]
    at, value, level, line = (np.concatenate(values) for values in zip(*parts, strict=True))
    filled = np.isfinite(value) & np.isfinite(at) & ~(np.isnan(level) & (temperature is not None))
    early = filled & (at <= 0)
    keep = filled & ~early
    _refuse(name, at[keep], value[keep], level[keep], line[keep])
    order = np.lexsort((at[keep], level[keep]))
    known = None if np.isnan(level[keep]).all() else level[keep][order]
    told = _told(block, columns, int((~filled).sum()), int(early.sum()))
    return CreepRecord(at[keep][order], value[keep][order], known), told


def mean_record(record: CreepRecord) -> CreepRecord:
    """The record with replicates of one time and temperature as one reading, their geometric mean."""
    level = np.zeros_like(record.time) if record.temperature_c is None else record.temperature_c
    keys, place = np.unique(np.column_stack([level, record.time]), axis=0, return_inverse=True)
    place = place.ravel()
    mean = np.exp(np.bincount(place, np.log(record.compliance)) / np.bincount(place))
    return CreepRecord(keys[:, 1], mean, None if record.temperature_c is None else keys[:, 0])


def _columns(block: Block, file: str) -> list[_Column]:
    """What each column is; those with other titles are passed over."""
    width = block.values.shape[1]
    titles = [" ".join(row[i].strip() for row in block.header if row[i].strip()) for i in range(width)]
    if not any(titles):
        raise InputError(f"{file}: no line of titles stands above the numbers: {WANTED}")
    found = [_column(i, title, file) for i, title in enumerate(titles)]
    return [column for column in found if column is not None]


def _column(index: int, title: str, file: str) -> _Column | None:
    """The role of a title: a unit of 1/stress makes it a compliance, whatever else it says."""
    text = title.lower()
    unit = _PER.search(text)
    if unit:
        rest = text[: unit.start()] + " " + text[unit.end() :]
        stated = _DEGREES.search(rest.replace("_", " "))
        pressure = PRESSURE[unit[1] or unit[2]]
        return _Column("compliance", index, title, 1 / pressure, temperature=stated and _degrees(stated))
    words = normalised(title)
    if re.search(r"temp", words):
        last = re.search(r"(?:°|º|deg|[\s_(\[])\s*([cfk])\b", text)
        if not last:
            raise InputError(f"{file}: column '{title}' states no unit of temperature: add it, as in temperature_c")
        return _Column("temperature", index, title, degrees=last[1])
    if _TIME.search(words):
        given = [word for word in words.split() if word in TIME]
        return _Column("time", index, title, TIME[given[-1]] if given else 1.0)
    if re.search(r"complian|kriech|creep|\bd\b|\bj\b", words):
        raise InputError(f"{file}: column '{title}' states no unit of compliance: add it, as in compliance_1_per_gpa")
    return None


def _degrees(match: re.Match[str]) -> float:
    value = float(match["value"].replace(",", ".")) * (-1 if match["sign"].strip() else 1)
    return DEGREES[match["unit"]](value)


def _roles(columns: list[_Column], file: str) -> tuple[_Column, _Column | None, list[_Column]]:
    """The columns of time, temperature (or None) and compliance; refuses what cannot be told apart."""
    by = {role: [c for c in columns if c.role == role] for role in ("time", "temperature", "compliance")}
    for role in ("time", "compliance"):
        if not by[role]:
            raise InputError(f"{file}: has no column of {role}: {WANTED}")
    for role in ("time", "temperature"):
        if len(by[role]) > 1:
            named = " and ".join(f"'{c.title}'" for c in by[role])
            raise InputError(f"{file}: the columns {named} could both be the {role}: keep one of them")
    compliances = by["compliance"]
    if len(compliances) > 1:
        if by["temperature"]:
            raise InputError(f"{file}: {len(compliances)} columns of compliance beside one of temperature: keep one")
        bare = [c.title for c in compliances if c.temperature is None]
        if bare:
            raise InputError(
                f"{file}: {len(compliances)} columns of compliance, and '{bare[0]}' does not say its temperature: add "
                "it to the title, as in 'D at -12 °C (1/GPa)'"
            )
    return by["time"][0], next(iter(by["temperature"]), None), compliances


def _readings(
    block: Block, time: _Column, temperature: _Column | None, column: _Column
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time (s), compliance (1/Pa), temperature (°C, NaN: not stated) and line of every cell of a column."""
    at = block.values[:, time.index] * time.factor
    value = block.values[:, column.index] * column.factor
    level = np.full(at.size, np.nan if column.temperature is None else column.temperature)
    if temperature is not None:
        level = DEGREES[temperature.degrees](block.values[:, temperature.index])
    return at, value, np.round(level, 6), block.line


def _refuse(file: str, time: np.ndarray, compliance: np.ndarray, level: np.ndarray, line: np.ndarray) -> None:
    """Refuse values that no asphalt has; all kinds of fault at once, the first row of each."""
    if not time.size:
        raise InputError(f"{file}: holds no reading with a time above zero: {WANTED}")
    per_gpa = compliance * GPA
    rules = (
        (compliance <= 0, "compliance", per_gpa, "1/GPa must be positive"),
        (
            (compliance > 0) & ((per_gpa < SMALLEST) | (per_gpa > LARGEST)),
            "compliance",
            per_gpa,
            f"1/GPa lies outside {SMALLEST:g} to {LARGEST:g} 1/GPa: check the unit in the title",
        ),
        ((level < -100) | (level > 100), "temperature", level, "°C lies outside -100 to 100 °C: check its unit"),
    )
    found = []
    for bad, name, values, rule in rules:
        if bad.any():
            at = int(np.argmax(bad))
            found.append(f"{file}: row {line[at]}: {name} = {values[at]:g} {rule}")
    if found:
        raise InputError("\n".join(found))


def _told(block: Block, columns: list[_Column], empty: int, early: int) -> tuple[str, ...]:
    """What was read and what was left out."""
    used = ", ".join(f"'{column.title}' ({column.role})" for column in columns)
    told = [f"Read from columns {used}; {block.encoding}, {block.separator}-separated, decimal {block.decimal}."]
    if empty:
        told.append(f"{empty} empty cells were left out.")
    if early:
        told.append(f"{early} readings at times not above zero were left out.")
    if block.skipped:
        told.append(f"{block.skipped} lines that hold no numbers were passed over.")
    return tuple(told)
