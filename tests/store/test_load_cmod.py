"""load_cmod.csv: identity of writing and reading, and every refusal with its row."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.curve import LoadCurve
from pipeline.core.units import MM
from pipeline.store.load_cmod import encode_load_cmod, read_load_cmod, write_load_cmod

GOOD = "time_s,cmod_mm,load_n\n0,0,0\n1,0.01,500\n2,0.02,900\n3,0.04,700\n"


@pytest.fixture
def problems(tmp_path):
    def read(text: str | bytes) -> list[str]:
        path = tmp_path / "load_cmod.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_load_cmod(path)[1]

    return read


@settings(max_examples=40)
@given(st.lists(st.tuples(*[st.floats(0.01, 100)] * 3), min_size=3, max_size=30), st.booleans())
def test_write_then_read_is_the_identity(tmp_path_factory, rows, with_line):
    steps = np.array(rows)
    cmod = np.concatenate([[0.0], np.cumsum(steps[:, 1])]) * MM
    load = np.concatenate([[0.0], steps[:, 2]])
    time = np.concatenate([[0.0], np.cumsum(steps[:, 0])])
    line = 2 * cmod if with_line else None
    path = tmp_path_factory.mktemp("curve") / "load_cmod.csv"
    write_load_cmod(path, LoadCurve(time, cmod, load, line))
    read, problems = read_load_cmod(path)
    assert problems == []
    for name in ("time", "cmod", "load") + (("load_line",) if with_line else ()):
        want = {"time": time, "cmod": cmod, "load": load, "load_line": line}[name]
        assert np.allclose(getattr(read, name), want, rtol=1e-11, atol=0)  # twelve digits are written
    assert with_line or read.load_line is None


def test_reads_the_contract_into_si(tmp_path):
    (tmp_path / "c.csv").write_text("time_s,cmod_mm,load_n,load_line_mm\n0,0,0,0\n1,0.01,500,0.02\n2,0.02,900,0.04\n")
    curve, problems = read_load_cmod(tmp_path / "c.csv")
    assert problems == []
    assert np.allclose(curve.cmod, [0, 1e-5, 2e-5], rtol=1e-15)  # rounding of a product
    assert np.allclose(curve.load_line, [0, 2e-5, 4e-5], rtol=1e-15)  # rounding of a product
    assert curve.load.tolist() == [0, 500, 900]


def test_columns_may_stand_in_any_order_and_crlf_and_bom_are_read(problems):
    text = "load_n,time_s,cmod_mm\r\n0,0,0\r\n500,1,0.01\r\n900,2,0.02\r\n"
    assert problems(b"\xef\xbb\xbf" + text.encode()) == []


@pytest.mark.parametrize(
    ("old", "new", "sentences"),
    [
        ("2,0.02,900", "2,nan,900", ["row 4: cmod_mm is nan"]),
        ("2,0.02,900", "2,0.02,inf", ["row 4: load_n is inf"]),
        ("2,0.02,900", "2,0.02,", ["row 4: load_n = '' is not a number"]),
        ("2,0.02,900", "2,0.02,9oo", ["row 4: load_n = '9oo' is not a number"]),
        ("2,0.02,900", "2,0,02,900", ["row 4: has 4 cells, the header has 3"]),
        ("2,0.02,900", "1,0.02,900", ["row 4: time_s = 1 must be larger than 1"]),
        ("0,0,0\n", "0,0.03,0\n", ["row 2: the record begins at cmod_mm = 0.03"]),
        ("0,0,0\n", "0,0,600\n", ["row 2: the record begins at load_n = 600"]),
        ("load_n", "load_kn", ["row 1 is 'time_s,cmod_mm,load_kn', the header must be time_s,cmod_mm,load_n"]),
        ("time_s,cmod_mm,load_n\n", "", ["row 1 is '0,0,0'"]),
        ("1,0.01,500\n2,0.02,900\n3,0.04,700\n", "", ["has 1 rows, a curve needs at least 3"]),
        ("\n0,0,0\n1,0.01,500\n2,0.02,900\n3,0.04,700\n", "\n", ["has no rows below its header"]),
        (",500\n2,0.02,900\n3,0.04,700", ",-500\n2,0.02,-900\n3,0.04,-700", ["load_n is nowhere positive"]),
    ],
)
def test_a_refusal_names_file_row_and_rule(problems, old, new, sentences):
    assert old in GOOD
    found = problems(GOOD.replace(old, new))
    assert len(found) == len(sentences)
    for problem, sentence in zip(found, sentences, strict=True):
        assert problem.startswith("load_cmod.csv: ")
        assert sentence in problem


def test_several_faults_are_listed_together_and_many_are_counted(problems):
    found = problems(GOOD.replace("0.01", "x").replace("0.02", "y"))
    assert ["row 3" in found[0], "row 4" in found[1]] == [True, True]
    many = "time_s,cmod_mm,load_n\n" + "1,nan,3\n" * 50
    assert problems(many)[-1] == "load_cmod.csv: 47 more rows have such faults"


def test_other_texts_are_refused_by_name(problems, tmp_path):
    assert problems(GOOD.encode("utf-16"))[0].startswith("load_cmod.csv: is not UTF-8 text")
    assert problems("")[0].startswith("load_cmod.csv: row 1 is ''")
    semicolons = GOOD.replace(",", ";")
    assert "cohesive-bpm new DIR --from FILE" in problems(semicolons)[0]
    (tmp_path / "folder").mkdir()
    assert "cannot be read" in read_load_cmod(tmp_path / "folder")[1][0]


def test_a_small_offset_of_the_gauge_is_accepted(curve, problems):
    """0.004 mm is below the 0.005 mm that may remain after zeroing."""
    text = encode_load_cmod(LoadCurve(curve.time, curve.cmod + 0.004 * MM, curve.load))
    assert problems(text) == []
