"""How a machine wrote its file: encoding, separators, header; turned into columns of numbers."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.errors import InputError, MissingFileError

SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "blanks"}
MISSING = {"", "-", "--", "---", "nan", "n/a", "na", "null", "none", "inf", "-inf", "#n/a", "#wert!", "#value!"}
SAMPLE = 400  # lines on which the dialect is decided
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+|\d{1,3}(,\d{3})+\.\d+)([eEdD][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+|\d{1,3}([. ']\d{3})+)?(,\d+)?([eE][+-]?\d+)?")
_CLOCK = re.compile(r"(\d+):(\d{2}):(\d{2}([.,]\d+)?)")
_ENCODINGS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


@dataclass(frozen=True)
class Block:
    """The numbers of a file and the text above them.

    Parameters
    ----------
    header : rows of cells that stand above the numbers and have as many columns, last one nearest
    values : (n, columns) array; NaN where a cell is empty or says that a value is missing
    line : (n,) array; line of the file, counted from 1
    skipped : int; lines below the header that are neither numbers nor blank
    encoding, separator, decimal : str
    """

    header: tuple[tuple[str, ...], ...]
    values: np.ndarray
    line: np.ndarray
    skipped: int
    encoding: str
    separator: str
    decimal: str


@dataclass(frozen=True)
class _Guess:
    """One way to read the lines: cells and numbers of each."""

    separator: str
    decimal: str
    cells: list[list[str]]
    numbers: list[list[float] | None]
    width: int  # the most frequent number of columns among rows of numbers
    rows: list[int]  # lines that hold this many


def read_block(path: Path) -> Block:
    """The table of numbers in a text file, in whatever dialect.

    Tab, semicolon, comma, bar or blanks between columns, decimal point or comma, thousands in groups,
    clock times (h:mm:ss), byte-order mark, UTF-8, UTF-16 or Latin-1, any line ending, text above and
    below. The dialect under which most lines are numbers wins; at a tie the decimal point.

    Raises
    ------
    MissingFileError, InputError
        where there is no file, or no table of at least two columns and three rows
    """
    text, encoding = _decoded(path)
    lines = text.splitlines()
    best = _guess(lines, *_likeliest(lines))
    if best.width < 2 or len(best.rows) < 3:
        raise InputError(
            f"{path.name}: no table of numbers was found (at least 2 columns and 3 rows): export the record as text "
            "with one column for each quantity, time among them"
        )
    rows = best.rows
    values = np.array([best.numbers[row] for row in rows], float)
    blank = sum(not any(cells) for cells in best.cells[rows[0] :])
    return Block(
        header=_header(best, lines, rows[0]),
        values=values,
        line=np.array(rows) + 1,
        skipped=len(lines) - rows[0] - len(rows) - blank,
        encoding=encoding,
        separator=SEPARATORS[best.separator],
        decimal="point" if best.decimal == "." else "comma",
    )


def _decoded(path: Path) -> tuple[str, str]:
    """Text of a file and the name of its encoding."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path} does not exist") from None
    except OSError as error:
        raise InputError(f"{path.name}: cannot be read ({error.strerror})") from None
    for mark, encoding in _ENCODINGS:
        if content.startswith(mark):
            return content.decode(encoding, "replace"), encoding.removesuffix("-sig")
    if b"\0" in content:
        raise InputError(f"{path.name}: is a binary file: export the record as text (CSV)")
    try:
        return content.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return content.decode("latin-1"), "latin-1"


def _likeliest(lines: list[str]) -> tuple[str, str]:
    """Separator and decimal mark under which most of a sample of the lines are numbers."""
    sample = lines[:: max(len(lines) // SAMPLE, 1)]
    guesses = [_guess(sample, separator, decimal) for separator in SEPARATORS for decimal in ".,"]
    best = max(guesses, key=lambda g: (len(g.rows) * (g.width > 1), g.width, g.decimal == "."))
    return best.separator, best.decimal


def _guess(lines: list[str], separator: str, decimal: str) -> _Guess:
    if separator == " ":
        cells = [line.split() for line in lines]
    else:
        cells = [[cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])] for line in lines]
    numbers = [_row_numbers(row, decimal) for row in cells]
    if all(len(row) > 2 and not row[-1] for row, found in zip(cells, numbers, strict=True) if found):
        cells = [row[:-1] if len(row) > 2 and not row[-1] else row for row in cells]  # a separator ends each line
        numbers = [_row_numbers(row, decimal) for row in cells]
    widths = Counter(len(row) for row in numbers if row is not None)
    width = max(widths, key=lambda w: (widths[w], w), default=0)
    rows = [i for i, row in enumerate(numbers) if row is not None and len(row) == width]
    return _Guess(separator, decimal, cells, numbers, width, rows)


def _row_numbers(cells: list[str], decimal: str) -> list[float] | None:
    """The numbers of a row, None where it holds anything else or nothing."""
    numbers = []
    for cell in cells:
        number = parse_number(cell, decimal)
        if number is None:
            return None
        numbers.append(number)
    return None if all(np.isnan(number) for number in numbers) else numbers


def parse_number(cell: str, decimal: str) -> float | None:
    """A number as machines write it, NaN for a missing one, None for text."""
    if cell.lower() in MISSING:
        return float("nan")
    clock = _CLOCK.fullmatch(cell)
    if clock:
        hours, minutes, seconds = (float(part.replace(",", ".")) for part in clock.groups()[:3])
        return 3600 * hours + 60 * minutes + seconds
    if decimal == ".":
        return float(re.sub("[dD]", "e", cell.replace(",", ""))) if _POINT.fullmatch(cell) else None
    if not _COMMA.fullmatch(cell) or not any(map(str.isdigit, cell)):
        return None
    return float(re.sub(r"[. ']", "", cell).replace(",", "."))


def _header(guess: _Guess, lines: list[str], first: int) -> tuple[tuple[str, ...], ...]:
    """Rows of as many cells right above the numbers, blank lines passed over."""
    found: list[tuple[str, ...]] = []
    for index in range(first - 1, -1, -1):
        cells = guess.cells[index]
        if not any(cells):
            if found:
                break
            continue
        if guess.separator == " ":
            cells = _titles_between_blanks(lines[index].strip(), cells, guess.width)
        if len(cells) > guess.width and not any(cells[guess.width :]):
            cells = cells[: guess.width]
        if len(cells) != guess.width:
            break
        found.insert(0, tuple(cells))
    return tuple(found)


def _titles_between_blanks(line: str, words: list[str], width: int) -> list[str]:
    """Titles of several words: apart by wide gaps, or each ended by its unit in brackets, or one word and a unit."""
    ways = (
        words,
        re.split(r"\s{2,}", line),
        re.findall(r"[^\s\[(<][^\[(<]*[\[(<][^\])>]*[\])>]", line),
        re.split(r"\s+(?![\[(<])", line),
    )
    return next((cells for cells in ways if len(cells) == width), words)
