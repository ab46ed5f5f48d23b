"""Numbers as machines write them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError, MissingFileError
from pipeline.store.dialect import parse_number, read_block


@pytest.fixture
def block(tmp_path):
    def read(text: str | bytes):
        (tmp_path / "r.txt").write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_block(tmp_path / "r.txt")

    return read


@pytest.mark.parametrize(
    ("cell", "decimal", "value"),
    [
        ("1.5", ".", 1.5), ("-3", ".", -3.0), ("+2e-3", ".", 2e-3), ("1.5D+2", ".", 150.0), (".5", ".", 0.5),
        ("5.", ".", 5.0), ("1,5", ",", 1.5), ("-3", ",", -3.0), ("2,5E-3", ",", 2.5e-3), ("1.234,5", ",", 1234.5),
        ("1 234,5", ",", 1234.5),
        ("1,234.5", ".", 1234.5), ("12,345,678.9", ".", 12345678.9),
        ("01:02:03.5", ".", 3723.5), ("0:00:10,25", ",", 10.25),
    ],
)  # fmt: skip
def test_numbers(cell, decimal, value):
    assert parse_number(cell, decimal) == pytest.approx(value, rel=1e-15)  # one rounding in the decimal conversion


@pytest.mark.parametrize("cell", ["1,5", "1,234", "abc", "1.2.3", "1e", "0x10", "1_000", "1 2", ".", "12:30"])
def test_what_is_no_number_with_a_decimal_point(cell):
    assert parse_number(cell, ".") is None


@pytest.mark.parametrize("cell", ["1.5", "1,", "1,2,3", "12.34,5", "", "e"])
def test_what_is_no_number_with_a_decimal_comma(cell):
    """An empty cell is a missing value, not text."""
    assert parse_number(cell, ",") is None or cell == ""


@settings(max_examples=40)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_python_writes_is_read_back(value):
    assert parse_number(repr(value), ".") == value
    assert parse_number(repr(value).replace(".", ","), ",") == value


@pytest.mark.parametrize("cell", ["", "-", "NaN", "n/a", "#WERT!"])
def test_missing_values(cell):
    assert np.isnan(parse_number(cell, "."))


@pytest.mark.parametrize(
    ("text", "separator", "decimal"),
    [
        ("a,b\n1.5,2\n2.5,3\n3.5,4\n", "comma", "point"),
        ("a;b\n1,5;2\n2,5;3\n3,5;4\n", "semicolon", "comma"),
        ("a;b\n1.5;2\n2.5;3\n3.5;4\n", "semicolon", "point"),
        ("a\tb\n1,5\t2\n2,5\t3\n3,5\t4\n", "tab", "comma"),
        ("a b\n 1.5   2\n 2.5   3\n 3.5   4\n", "blanks", "point"),
        ("a b\n1,5 2\n2,5 3\n3,5 4\n", "blanks", "comma"),
        ("a|b\n1.5|2\n2.5|3\n3.5|4\n", "bar", "point"),
        ('a,b\n"1,5","2"\n"2,5","3"\n"3,5","4"\n', "comma", "comma"),
        ("a,b\n1.5,2,\n2.5,3,\n3.5,4,\n", "comma", "point"),
    ],
)
def test_dialects(block, text, separator, decimal):
    read = block(text)
    assert (read.separator, read.decimal) == (separator, decimal)
    assert read.values.tolist() == [[1.5, 2], [2.5, 3], [3.5, 4]]
    assert read.header == (("a", "b"),)


def test_whole_numbers_read_the_same_in_every_dialect(block):
    for separator in (",", ";", "\t", " ", "|"):
        rows = "\n".join(separator.join(map(str, row)) for row in ((1, 2, 3), (4, 5, 6), (7, 8, 9)))
        assert block(rows).values.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]


def test_text_around_the_numbers_is_passed_over(block):
    read = block("Machine;7\nDate;01.02.2020\n\nt;F\n[s];[kN]\n0;1\n1;2\npaused\n2;3\n\nEnd of test\n")
    assert read.header == (("t", "F"), ("[s]", "[kN]"))
    assert read.values.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert read.line.tolist() == [6, 7, 9]
    assert read.skipped == 2


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_encodings_and_line_endings(block, encoding, newline):
    read = block(newline.join(["Öffnung;Kraft", "1,5;2", "2,5;3", "3,5;4"]).encode(encoding))
    assert read.header == (("Öffnung", "Kraft"),)
    assert read.values.shape == (3, 2)


@pytest.mark.parametrize(
    "line", ["Time [s] Load cell [kN]", "Time   Load cell", "Time Load", "Time (s)  Load", "Time (s) Load (kN)"]
)
def test_titles_between_blanks(block, line):
    titles = block(f"{line}\n0 1\n1 2\n2 3\n").header[-1]
    assert len(titles) == 2
    assert titles[0].startswith("Time")
    assert titles[1].startswith("Load")


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "no table of numbers"),
        (b"just text\nand more\n", "no table of numbers"),
        (b"1\n2\n3\n4\n", "at least 2 columns"),
        (b"1,2\n3,4\n", "3 rows"),
        (b"PK\x03\x04\0\0\0\0", "is a binary file"),
    ],
)
def test_what_holds_no_record_is_refused_by_name(block, content, sentence):
    with pytest.raises(InputError, match=r"^r\.txt: ") as error:
        block(content)
    assert sentence in str(error.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MissingFileError, match=r"none\.csv does not exist"):
        read_block(tmp_path / "none.csv")


def test_long_records_are_read_in_time_proportional_to_their_length(block):
    """A tenth of a minute of a machine at 10 kHz; a quadratic reader would need minutes."""
    rows = "\n".join(f"{i};{i / 7:.3f};{i}".replace(".", ",") for i in range(20_000))
    assert block("a;b;c\n" + rows).values.shape == (20_000, 3)
