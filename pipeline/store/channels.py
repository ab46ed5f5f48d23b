"""What the columns of a machine record mean, from their names and units."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.units import KN, MINUTE, MM, UM
from pipeline.store.dialect import Block

INCH, POUND = 0.0254, 4.4482216152605
TIME = {
    "s": 1.0,
    "sec": 1.0,
    "sek": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "min": MINUTE,
    "h": 3600.0,
    "hr": 3600.0,
}
LENGTH = {
    "mm": MM,
    "um": UM,
    "micron": UM,
    "microns": UM,
    "cm": 1e-2,
    "m": 1.0,
    "in": INCH,
    "inch": INCH,
    "mil": INCH / 1e3,
}
FORCE = {"n": 1.0, "newton": 1.0, "kn": KN, "dan": 10.0, "lbf": POUND, "lb": POUND, "kip": 1e3 * POUND, "kgf": 9.80665}
UNITS = {
    "time": TIME,
    "cmod": LENGTH,
    "load": FORCE,
    "load_line": LENGTH,
    "load_min": FORCE,
    "load_max": FORCE,
}
DEFAULT = {"time": "s", "cmod": "mm", "load": "n", "load_line": "mm", "load_min": "n", "load_max": "n"}
KNOWN = set(TIME) | set(LENGTH) | set(FORCE)
SYNONYMS = {
    "time": ("time", "zeit", "prufzeit", "messzeit", "testzeit", "elapsed", "temps", "tiempo", "tempo", "t"),
    "cmod": (
        "crack mouth opening displacement", "crack mouth opening", "crack opening displacement", "crack opening",
        "crack mouth", "mouth opening", "cmod", "cod", "clip gauge", "clip gage", "clipgauge", "clip on gauge", "clip",
        "extensometer", "rissmundoffnung", "rissoffnung", "rissaufweitung", "kerboffnung", "ouverture de fissure",
    ),
    "load": (
        "load", "force", "axial force", "axial load", "load cell", "standard force", "kraft", "last", "prufkraft",
        "standardkraft", "prufraft", "charge", "carga", "fuerza", "forza", "f", "p",
    ),
    "load_line": (
        "load line displacement", "load line", "loadline", "lld", "stroke", "crosshead", "crosshead displacement",
        "axial displacement", "actuator", "actuator displacement", "ram", "extension", "position", "displacement",
        "deflection", "weg", "traverse", "traversenweg", "kolbenweg", "standardweg", "prufweg", "durchbiegung",
        "deplacement",
    ),
    "load_min": ("load min", "min load", "force min", "min force", "minimum load", "lower load", "f min", "p min"),
    "load_max": ("load max", "max load", "force max", "max force", "maximum load", "upper load", "f max", "p max"),
}  # fmt: skip


@dataclass(frozen=True)
class Channel:
    """One column of the record.

    Parameters
    ----------
    role : "time", "cmod", "load", "load_line", "load_min" or "load_max"
    column : int, from 0
    title : str; as the file names it
    unit : str; as it was understood
    assumed : bool; the file gives no unit
    values : (n,) array in SI
    """

    role: str
    column: int
    title: str
    unit: str
    assumed: bool
    values: np.ndarray


def find_channels(
    block: Block, file: str, columns: Mapping[str, str | int] | None = None, units: Mapping[str, str] | None = None
) -> dict[str, Channel]:
    """The columns that matter, by role.

    Parameters
    ----------
    block : Block
    file : str; for messages
    columns : role → title of a column, or its number from 1; what is not given is found by its title
    units : role → unit, where the file's own is missing or wrong

    Raises
    ------
    InputError
        for a title or unit that the file or this table does not know, and where two columns fit alike
    """
    titles, stated = _titles(block)
    chosen = {role: _given(block, titles, role, wanted, file) for role, wanted in (columns or {}).items()}
    for role in SYNONYMS:
        if role not in chosen:
            column = _matching(titles, role, set(chosen.values()), file)
            if column is not None:
                chosen[role] = column
    return {role: _channel(block, titles, stated, role, column, units or {}, file) for role, column in chosen.items()}


def _channel(
    block: Block, titles: list[str], stated: list[str], role: str, column: int, units: Mapping[str, str], file: str
) -> Channel:
    factors = UNITS[role]
    unit = normalised(units[role]).replace(" ", "") if role in units else stated[column]
    assumed = not unit
    unit = unit or DEFAULT[role]
    if unit not in factors:
        raise InputError(
            f"{file}: column '{titles[column]}' ({role}) is in '{unit}', known are {', '.join(factors)}: state the unit"
        )
    return Channel(role, column, titles[column], unit, assumed, block.values[:, column] * factors[unit])


def normalised(text: str) -> str:
    """Lower case without accents; everything but letters and digits becomes one blank."""
    text = text.replace("µ", "u").replace("μ", "u").replace("ß", "ss")
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", " ", plain).strip()


def _titles(block: Block) -> tuple[list[str], list[str]]:
    """Title and unit ('' where none is stated) of every column."""
    width = block.values.shape[1]
    rows = [row for row in block.header if not _is_unit_row(row)]
    unit_rows = [row for row in block.header if _is_unit_row(row)]
    best = max(rows, key=lambda row: sum(_role_of(cell) is not None for cell in row), default=("",) * width)
    split = [_split_unit(cell) for cell in best]
    below = [next((u for row in unit_rows if (u := _bare_unit(row[i]))), "") for i in range(width)]
    return [title for title, _ in split], [own or under for (_, own), under in zip(split, below, strict=True)]


def _is_unit_row(row: tuple[str, ...]) -> bool:
    """Every cell that is not empty is a unit, and at least one stands there."""
    filled = [cell for cell in row if cell.strip()]
    return bool(filled) and all(_bare_unit(cell) for cell in filled)


def _bare_unit(cell: str) -> str:
    """The unit that a cell consists of, '' for anything else."""
    unit = normalised(cell).replace(" ", "")
    return unit if unit in KNOWN else ""


def _split_unit(cell: str) -> tuple[str, str]:
    """Title and unit of 'Force [kN]', 'Force (kN)', 'Force / kN', 'force_kn', 'Force, kN', 'Force in kN', 'Force kN'.

    A last word that does not measure what the title names is no unit: 'load_min' is not in minutes.
    """
    bracket = re.fullmatch(r"(.*?)\s*[\[(<{]\s*([^\])>}]*)\s*[\])>}]\s*", cell)
    if bracket and _bare_unit(bracket[2]):
        return bracket[1].strip(" _-/,:") or cell, _bare_unit(bracket[2])
    tail = re.fullmatch(r"(.+?)(?:\s+in\s+|\s*[/,_:]\s*|\s+)([A-Za-zµμ]+)\.?\s*", cell)
    if tail and (unit := _bare_unit(tail[2])):
        title = tail[1].strip(" _-/,:")
        role = _best_role(title)
        if role is None or unit in UNITS[role]:
            return title, unit
    return cell.strip(), ""


def _fit(title: str, role: str) -> int:
    """How well a title fits: letters of its longest synonym, as whole words; one-letter names must be all of it.

    A word for the crack or its gauge counts more than any other: 'displacement (clip gauge)' is CMOD.
    """
    words = re.sub(r"(?<=[a-z])(?=\d)", " ", normalised(title))
    fits = [len(s) for s in SYNONYMS[role] if (s == words if len(s) == 1 else f" {s} " in f" {words} ")]
    return max(fits) + (100 if role == "cmod" else 0) if fits else 0


def _best_role(title: str) -> str | None:
    """The role whose synonyms fit a title best."""
    role = max(SYNONYMS, key=lambda r: _fit(title, r))
    return role if _fit(title, role) else None


def _role_of(cell: str) -> str | None:
    """The role of a cell of the header, its unit left aside."""
    return _best_role(_split_unit(cell)[0])


def _matching(titles: list[str], role: str, taken: set[int], file: str) -> int | None:
    """The column whose title fits a role, None where none does."""
    fits = {i: _fit(t, role) for i, t in enumerate(titles) if i not in taken and _role_of(t) == role}
    if not fits:
        return None
    best = [i for i, fit in fits.items() if fit == max(fits.values())]
    if len(best) > 1:
        named = " and ".join(f"'{titles[i]}'" for i in best)
        raise InputError(f"{file}: the columns {named} could both be {role}: say which one is meant")
    return best[0]


def _given(block: Block, titles: list[str], role: str, wanted: str | int, file: str) -> int:
    """The column that the user names."""
    if role not in UNITS:
        raise InputError(f"{role} is no column of a record: known are {', '.join(UNITS)}")
    width = block.values.shape[1]
    if isinstance(wanted, int) or wanted.strip().isdecimal():
        if not 1 <= int(wanted) <= width:
            raise InputError(f"{file}: has no column {wanted} for {role}: they are counted 1 to {width}")
        return int(wanted) - 1
    name = normalised(wanted)
    same = [i for i, t in enumerate(titles) if name in {normalised(t), *(normalised(row[i]) for row in block.header)}]
    if len(same) != 1:
        shown = ", ".join(f"'{title}'" for title in titles if title) or "untitled columns only"
        raise InputError(f"{file}: no single column is called '{wanted}' ({role}): there are {shown}")
    return same[0]
