"""Records as testing machines write them, turned into clean load–CMOD curves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.units import MM
from pipeline.store.channels import Channel, find_channels
from pipeline.store.dialect import Block, read_block
from pipeline.store.toe import without_foot

DISORDER = 0.1  # share of rows that may stand still or run back in time
PRETTY = {"n": "N", "kn": "kN", "dan": "daN", "um": "µm"}


@dataclass(frozen=True)
class RecordReport:
    """What was read and what was done with it.

    Parameters
    ----------
    sentences : in the order of the work
    rows_read, rows_kept : int
    envelope : bool; the file gave a lower and an upper load
    """

    sentences: tuple[str, ...]
    rows_read: int
    rows_kept: int
    envelope: bool


@dataclass(frozen=True)
class Record:
    """A curve, with load_std where the file was an envelope, and the report."""

    curve: LoadCurve
    report: RecordReport

    @property
    def load_std(self) -> float | None:
        """Root mean square of the load's standard deviation (N), None where it is not known."""
        std = self.curve.load_std
        return None if std is None else float(np.sqrt(np.mean(std**2)))


def read_record(
    path: Path,
    cmod_rate: float | None = None,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    remove_toe: bool = True,
) -> Record:
    """Read a machine's own file: any dialect, any column names and units that the tables know.

    An envelope (columns for the lower and the upper load) becomes its middle, with half its half width as
    standard deviation: the two bounds are taken as ±2σ. It is no raw record, so no toe is taken off it.

    Parameters
    ----------
    path : Path
    cmod_rate : float, m/s; gives the time where the file has none: time = CMOD/rate
    columns : role ("time", "cmod", "load", "load_line", "load_min", "load_max") → title or number from 1
    units : role → unit, where the file's own is missing or wrong
    remove_toe : bool

    Raises
    ------
    MissingFileError, InputError
        naming what was not found and what to state
    """
    block = read_block(path)
    channels = find_channels(block, path.name, columns, units)
    envelope = {"load_min", "load_max"} <= channels.keys() and "load" not in channels
    _need(path.name, channels, envelope, cmod_rate)
    told = [_how_read(path.name, block), *map(_how_understood, channels.values())]
    data = _timed(
        path.name, _signed(_complete(path.name, _quantities(channels, envelope), told), told), cmod_rate, told
    )
    curve = LoadCurve(**data)
    if remove_toe and not envelope:
        curve, done = without_foot(curve)
        told += done
    return Record(curve, RecordReport(tuple(told), len(block.values), curve.time.size, envelope))


def _need(file: str, channels: Mapping[str, Channel], envelope: bool, cmod_rate: float | None) -> None:
    """Refuse a record without CMOD, load or any way to its time."""
    missing = [role for role in ("cmod", "load") if role not in channels and not (role == "load" and envelope)]
    if missing:
        raise InputError(
            f"{file}: no column was recognised as {' or '.join(missing)}: name the columns, such as cmod=2 "
            "(their number, from 1) or load='title'"
        )
    if "time" not in channels and cmod_rate is None:
        raise InputError(f"{file}: has no column for time: state the CMOD rate of the test, from which time follows")


def _quantities(channels: Mapping[str, Channel], envelope: bool) -> dict[str, np.ndarray]:
    """Arrays by the names of LoadCurve; an envelope as its middle and a quarter of its width."""
    data = {role: c.values for role, c in channels.items() if role in ("time", "cmod", "load", "load_line")}
    if envelope:
        low, high = channels["load_min"].values, channels["load_max"].values
        data |= {"load": (low + high) / 2, "load_std": np.abs(high - low) / 4}
    return data


def _signed(data: dict[str, np.ndarray], told: list[str]) -> dict[str, np.ndarray]:
    """Load and openings counted positive, whatever the machine does."""
    turned = dict(data)
    for name, grows in (("load", _extreme), ("cmod", _growth), ("load_line", _growth)):
        if name in data and grows(data[name]) < 0:
            turned[name] = -data[name]
            told.append(f"The sign of {name} was turned: the machine counts it negative.")
    return turned


def _extreme(values: np.ndarray) -> float:
    """The value farthest from zero."""
    return float(values[np.argmax(np.abs(values))])


def _growth(values: np.ndarray) -> float:
    """How much the last twentieth lies above the first."""
    few = max(values.size // 20, 1)
    return float(np.mean(values[-few:]) - np.mean(values[:few]))


def _complete(file: str, data: dict[str, np.ndarray], told: list[str]) -> dict[str, np.ndarray]:
    """Rows in which nothing is missing."""
    whole = np.all([np.isfinite(values) for values in data.values()], axis=0)
    if whole.sum() < 3:
        raise InputError(f"{file}: only {whole.sum()} rows hold all of {', '.join(data)}: a curve needs at least 3")
    if not whole.all():
        told.append(f"{(~whole).sum()} rows without all values were left out.")
    return {name: values[whole] for name, values in data.items()}


def _timed(file: str, data: dict[str, np.ndarray], cmod_rate: float | None, told: list[str]) -> dict[str, np.ndarray]:
    """Rows whose time increases; time from CMOD where the file has none."""
    by_cmod = "time" not in data
    if by_cmod:
        rate = float(cmod_rate or np.nan)
        data = {"time": data["cmod"] / rate, **data}
        told.append(f"The file has no time: time is CMOD divided by {rate / MM * 60:.4g} mm/min.")
    else:
        data = data | {"time": np.unwrap(data["time"], period=86400.0) if _is_clock(data["time"]) else data["time"]}
    reached = np.maximum.accumulate(data["time"])
    rising = np.append(True, np.diff(reached) > 0)
    lost = int((~rising).sum())
    if not by_cmod and lost > DISORDER * rising.size:
        raise InputError(
            f"{file}: time stands still or runs back in {lost} of {rising.size} rows: is another column the time?"
        )
    if rising.sum() < 3:
        raise InputError(f"{file}: only {rising.sum()} rows follow one another in time: a curve needs at least 3")
    if lost:
        told.append(f"{lost} rows whose {'CMOD' if by_cmod else 'time'} does not increase were left out.")
    return {name: values[rising] for name, values in data.items()}


def _is_clock(time: np.ndarray) -> bool:
    """A time of day that passes midnight once: one fall by nearly a day."""
    falls = np.diff(time)
    return bool(time.max() < 86400 and (falls < -43200).sum() == 1)


def _how_read(file: str, block: Block) -> str:
    rows, columns = block.values.shape
    text = (
        f"{file}: {rows} rows of {columns} columns from line {block.line[0]} on, {block.encoding}, separated by "
        f"{block.separator}, decimal {block.decimal}."
    )
    return text + (f" {block.skipped} other lines were passed over." if block.skipped else "")


def _how_understood(channel: Channel) -> str:
    unit = PRETTY.get(channel.unit, channel.unit)
    how = f"{unit}, assumed: the file states no unit" if channel.assumed else unit
    title = f"'{channel.title}'" if channel.title else "untitled"
    return f"{channel.role}: column {channel.column + 1}, {title}, in {how}."
