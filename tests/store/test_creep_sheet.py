"""Creep records as laboratories write them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError, MissingFileError
from pipeline.store.creep import CreepRecord, encode_creep
from pipeline.store.creep_sheet import mean_record, read_creep_sheet

CLEAN = "time_s,compliance_1_per_gpa,temperature_c\n1,0.1,-20\n10,0.12,-20\n1,0.2,-10\n10,0.3,-10\n"


def read(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "creep.csv"
    path.write_bytes(text.encode(encoding))
    return read_creep_sheet(path)


# the same record as CLEAN: dialects, units, one column a temperature
SAME = {
    "clean": CLEAN,
    "semicolons, decimal comma, BOM": "\ufeffTime [s];D(t) [1/GPa];Temperature [°C]\r\n"
    "1;0,1;-20\r\n10;0,12;-20\r\n1;0,2;-10\r\n10;0,3;-10\r\n",
    "minutes, per MPa, kelvin": "Temp (K)\tLoading time (min)\tCreep compliance (1/MPa)\n"
    "253.15\t0.016666666667\t1.0e-4\n253.15\t0.16666666667\t1.2e-4\n"
    "263.15\t0.016666666667\t2e-4\n263.15\t0.16666666667\t3e-4\n",
    "fahrenheit, GPa^-1": "t (s),D (GPa^-1),temperature_f\n1,0.1,-4\n10,0.12,-4\n1,0.2,14\n10,0.3,14\n",
    "vendor header, units below": "IDT creep\nOperator: A\n\nTime,Compliance,Temperature\ns,1/GPa,°C\n"
    "1,0.1,-20\n10,0.12,-20\n1,0.2,-10\n10,0.3,-10\n",
    "one column each, any order, gaps": "time_s,D at -10 °C (1/GPa),D at -20 °C (1/GPa)\n"
    "10,0.3,\n1,0.2,0.1\n10,,0.12\n",
    "key-like titles": "time_s,compliance_1_per_gpa_m20c,compliance_1_per_gpa_-10c\n1,0.1,0.2\n10,0.12,0.3\n100,,\n",
    "a reading at zero": "time_s,compliance_1_per_gpa,temperature_c\n0,0,-20\n1,0.1,-20\n10,0.12,-20\n"
    "1,0.2,-10\n10,0.3,-10\n",
}


@pytest.mark.parametrize("text", SAME.values(), ids=SAME)
def test_every_dialect_says_the_same(tmp_path, text):
    record, told = read(tmp_path, text)
    assert record.time == pytest.approx([1, 10, 1, 10], rel=1e-9)  # digits in the file
    assert record.compliance == pytest.approx([1e-10, 1.2e-10, 2e-10, 3e-10], rel=1e-9)  # digits in the file
    assert record.temperature_c == pytest.approx([-20, -20, -10, -10], abs=1e-6)  # rounded to this
    assert told[0].startswith("Read from columns")


def test_what_is_left_out_is_told(tmp_path):
    assert "2 empty cells were left out." in read(tmp_path, SAME["one column each, any order, gaps"])[1]
    assert "1 readings at times not above zero were left out." in read(tmp_path, SAME["a reading at zero"])[1]


def test_a_record_may_say_no_temperature(tmp_path):
    record, _ = read(tmp_path, "time_s,compliance_1_per_gpa\n1,0.1\n2,0.2\n3,0.3\n")
    assert record.temperature_c is None


def test_one_column_may_say_it_in_its_title(tmp_path):
    record, _ = read(tmp_path, "time_s;D bei -12,5 °C [1/GPa]\n1;0,1\n2;0,2\n3;0,3\n")
    assert record.temperature_c.tolist() == [-12.5, -12.5, -12.5]


def test_replicates_are_averaged_geometrically():
    record = CreepRecord(np.array([1.0, 1, 2, 1]), np.array([1.0, 4, 5, 7]), np.array([0.0, 0, 0, 9]))
    mean = mean_record(record)
    assert mean.time.tolist() == [1, 2, 1]
    assert mean.compliance == pytest.approx([2, 5, 7], rel=1e-15)  # rounding of a logarithm
    assert mean.temperature_c.tolist() == [0, 0, 9]


@settings(max_examples=40)
@given(
    st.lists(st.floats(1e-3, 1e5), min_size=4, max_size=12, unique=True),
    st.lists(st.floats(1e-3, 1e3), min_size=12, max_size=12),
)
def test_what_we_write_is_read_back(tmp_path_factory, times, compliance):
    time = np.sort(times)
    written = CreepRecord(time, np.array(compliance[: time.size]) * 1e-9, np.full(time.size, -12.0))
    path = tmp_path_factory.mktemp("creep") / "creep.csv"
    path.write_bytes(encode_creep(written))
    record, _ = read_creep_sheet(path)
    assert record.time == pytest.approx(written.time, rel=1e-11)  # twelve digits are written
    assert record.compliance == pytest.approx(written.compliance, rel=1e-11)  # likewise


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (CLEAN.replace("_1_per_gpa", ""), "column 'compliance' states no unit of compliance"),
        (CLEAN.replace("temperature_c", "temperature"), "column 'temperature' states no unit of temperature"),
        (CLEAN.replace("compliance_1_per_gpa", "stress_mpa"), "has no column of compliance"),
        (CLEAN.replace("time_s", "x"), "has no column of time"),
        (CLEAN.split("\n", 1)[1], "no line of titles"),
        (CLEAN.replace("0.12", "-0.12"), "row 3: compliance = -0.12 1/GPa must be positive"),
        (CLEAN.replace("gpa", "pa"), "row 2: compliance = 1e+08 1/GPa lies outside 0.0001 to 10000 1/GPa"),
        (CLEAN.replace("-20", "-253"), "row 2: temperature = -253 °C lies outside"),
        ("time_s,time_min,d_1_per_gpa\n1,1,1\n2,2,2\n3,3,3\n", "could both be the time"),
        ("time_s,D 1/GPa,J 1/GPa\n1,1,1\n2,2,2\n3,3,3\n", "'D 1/GPa' does not say its temperature"),
        ("time_s,D 1/GPa,J 1/GPa,temp_c\n1,1,1,1\n2,2,2,1\n3,3,3,1\n", "beside one of temperature"),
        ("time_s,d_1_per_gpa\n-1,1\n0,2\n-3,3\n", "no reading with a time above zero"),
        ("hello\nworld\n", "no table of numbers"),
    ],
)
def test_a_refusal_is_one_message_that_names_the_place(tmp_path, text, sentence):
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert sentence in str(error.value)
    assert "creep.csv" in str(error.value)


def test_missing_files_and_folders_are_named(tmp_path):
    with pytest.raises(MissingFileError, match="does not exist"):
        read_creep_sheet(tmp_path / "creep.csv")
    with pytest.raises(InputError, match="is a folder"):
        read_creep_sheet(tmp_path)
