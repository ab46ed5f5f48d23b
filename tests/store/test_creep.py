"""creep.csv."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import BundleError, MissingFileError
from pipeline.store.creep import encode_creep, read_creep

GOOD = "time_s,compliance_1_per_gpa,temperature_c\n1,0.1,-20\n10,0.12,-20\n1,0.2,-10\n10,0.3,-10\n"


def read(tmp_path, text):
    (tmp_path / "creep.csv").write_text(text)
    return read_creep(tmp_path / "creep.csv")


def test_reads_si_and_lets_time_begin_again_at_another_temperature(tmp_path):
    record = read(tmp_path, GOOD)
    assert np.allclose(record.compliance, [1e-10, 1.2e-10, 2e-10, 3e-10], rtol=1e-15)  # rounding of a quotient
    assert record.temperature_c.tolist() == [-20, -20, -10, -10]
    assert read(tmp_path, "time_s,compliance_1_per_gpa\n1,0.1\n2,0.2\n").temperature_c is None


def test_write_then_read_is_the_identity(tmp_path):
    record = read(tmp_path, GOOD)
    (tmp_path / "creep.csv").write_bytes(encode_creep(record))
    again = read_creep(tmp_path / "creep.csv")
    for name in ("time", "compliance", "temperature_c"):
        assert np.allclose(getattr(again, name), getattr(record, name), rtol=1e-11)  # twelve digits are written


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("10,0.12,-20", "1,0.12,-20", "row 3: time_s = 1 must increase at one temperature"),
        ("1,0.1,-20", "0,0.1,-20", "row 2: time_s = 0 must be positive"),
        ("0.12", "-0.12", "row 3: compliance_1_per_gpa = -0.12 lies outside"),
        ("0.12", "1.2e-10", "check the unit"),
        ("0.12", "nan", "row 3: compliance_1_per_gpa is nan"),
    ],
)
def test_a_refusal_names_row_and_rule(tmp_path, old, new, sentence):
    with pytest.raises(BundleError) as error:
        read(tmp_path, GOOD.replace(old, new))
    assert any(sentence in problem for problem in error.value.problems)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MissingFileError, match=r"creep\.csv does not exist"):
        read_creep(tmp_path / "creep.csv")
