"""Machine records: the same test in any dialect reads the same; measured envelopes give their published numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.core.units import KN, MM, UM
from pipeline.store.records import read_record

TITLES = {
    "english": ("Time", "CMOD", "Load", "Stroke"),
    "german": ("Zeit", "Rissöffnung", "Kraft", "Traversenweg"),
    "short": ("t", "COD", "F", "LLD"),
    "long": ("Running Time", "Crack Mouth Opening Displacement", "Axial Force", "Load Line Displacement"),
}
PREAMBLE = ["Test Works 4", "Operator{s}n/a", "Date{s}01.02.2020 10:00", "Specimen{s}SEB-07{s}{s}", ""]


@dataclass(frozen=True)
class Dialect:
    """One way in which a machine may write a record."""

    separator: str
    decimal: str
    newline: str
    encoding: str
    titles: str
    preamble: bool
    units: str  # "brackets", "row", "slash", "none"
    cmod_unit: str
    load_unit: str
    sign: int
    trailing: bool
    order: tuple[int, ...]

    def number(self, value: float) -> str:
        return f"{value:.10g}".replace(".", self.decimal)

    def write(self, table: np.ndarray) -> bytes:
        """Columns time (s), CMOD (m), load (N), load line (m) as this machine would write them."""
        length = {"mm": MM, "µm": UM, "m": 1.0}[self.cmod_unit]
        force = {"N": 1.0, "kN": KN}[self.load_unit]
        scaled = table / [1.0, length, force * self.sign, MM]
        units = ("s", self.cmod_unit, self.load_unit, "mm")
        names = TITLES[self.titles]
        form = {"brackets": "{} [{}]", "slash": "{} / {}"}.get(self.units, "{}")
        head = [[form.format(n, u) for n, u in zip(names, units, strict=True)]]
        head += [list(units)] if self.units == "row" else []
        rows = head + [[self.number(v) for v in row] for row in scaled.tolist()]
        end = self.separator if self.trailing else ""
        lines = [self.separator.join(row[i] for i in self.order) + end for row in rows]
        top = [line.format(s=self.separator) for line in PREAMBLE] if self.preamble else []
        return (self.newline.join(top + lines) + self.newline).encode(self.encoding)


@st.composite
def dialects(draw) -> Dialect:
    separator, decimal = draw(
        st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", ".")])
    )
    units = draw(st.sampled_from(["brackets", "row", "slash", "none"]))
    return Dialect(
        separator=separator,
        decimal=decimal,
        newline=draw(st.sampled_from(["\n", "\r\n", "\r"])),
        encoding=draw(st.sampled_from(["utf-8", "utf-8-sig", "latin-1", "utf-16"])),
        titles=draw(st.sampled_from(sorted(TITLES))),
        preamble=draw(st.booleans()),
        units=units,
        cmod_unit="mm" if units == "none" else draw(st.sampled_from(["mm", "µm", "m"])),
        load_unit="N" if units == "none" else draw(st.sampled_from(["N", "kN"])),
        sign=draw(st.sampled_from([1, -1])),
        trailing=draw(st.booleans()),
        order=tuple(draw(st.permutations(range(4)))),
    )


def record_table(seed: int = 0) -> np.ndarray:
    """A noisy record of 120 rows whose peak is 2.9 kN."""
    cmod = np.linspace(0, 0.5, 120) * MM
    x = cmod / (0.06 * MM)
    load = 2900 * x * np.exp(1 - x) + np.random.default_rng(seed).normal(0, 5, 120)
    return np.column_stack([cmod / (0.5 * MM) * 60, cmod, load, 1.4 * cmod])


@settings(max_examples=100)
@given(dialects())
def test_the_same_record_in_any_dialect_reads_the_same(tmp_path_factory, dialect):
    table = record_table()
    path = tmp_path_factory.mktemp("record") / "export.txt"
    path.write_bytes(dialect.write(table))
    record = read_record(path, remove_toe=False)
    read = np.column_stack([record.curve.time, record.curve.cmod, record.curve.load, record.curve.load_line])
    assert np.allclose(read, table, rtol=1e-9, atol=0)  # ten digits are written


@settings(max_examples=20)
@given(dialects(), st.integers(0, 5))
def test_toe_removal_does_not_depend_on_the_dialect(tmp_path_factory, dialect, seed):
    table = record_table(seed) + np.array([0, 0.02 * MM, 30, 0])
    folder = tmp_path_factory.mktemp("record")
    (folder / "a.txt").write_bytes(dialect.write(table))
    plain = Dialect(",", ".", "\n", "utf-8", "english", False, "brackets", "mm", "N", 1, False, (0, 1, 2, 3))
    (folder / "b.txt").write_bytes(plain.write(table))
    one, other = (read_record(folder / name).curve for name in ("a.txt", "b.txt"))
    assert one.cmod.size == other.cmod.size
    assert np.allclose(one.cmod, other.cmod, rtol=0, atol=1e-6 * MM)  # ten digits of 0.5 mm, through a median line
    assert np.allclose(one.load, other.load, rtol=1e-9, atol=1e-9)  # ten digits are written


@pytest.fixture
def record(tmp_path):
    def read(text: str, **options):
        (tmp_path / "r.csv").write_text(text)
        return read_record(tmp_path / "r.csv", **options)

    return read


HEAD = "Time [s];CMOD [mm];Load [kN]\n"
RISE = "".join(f"{i};{0.002 * i:.4f};{min(0.1 * i, 2.0):.3f}\n" for i in range(30))


def test_the_report_says_in_order_what_was_done(record):
    read = record(HEAD + RISE.replace("12;0.0240;1.200", "12;;1.200"))
    told = read.report.sentences
    assert told[0] == "r.csv: 30 rows of 3 columns from line 2 on, utf-8, separated by semicolon, decimal point."
    assert "load: column 3, 'Load', in kN." in told
    assert "1 rows without all values were left out." in told
    assert "CMOD is now counted" in told[-1]
    assert (read.report.rows_read, read.report.rows_kept, read.report.envelope) == (30, 29, False)


def test_units_that_are_not_stated_are_assumed_and_said(record):
    told = record("Time;CMOD;Load\n" + RISE, remove_toe=False).report.sentences
    assert "load: column 3, 'Load', in N, assumed: the file states no unit." in told


def test_signs_are_turned_and_said(record):
    rows = "".join(f"{i};{-0.002 * i:.4f};{-min(0.1 * i, 2.0):.3f}\n" for i in range(30))
    read = record(HEAD + rows, remove_toe=False)
    assert read.curve.load.max() == pytest.approx(2000, rel=1e-12)  # kN to N
    assert read.curve.cmod[-1] == pytest.approx(0.058 * MM, rel=1e-12)  # mm to m
    assert sum("was turned" in sentence for sentence in read.report.sentences) == 2


def test_repeated_times_are_left_out_and_a_disordered_column_refused(record):
    read = record(HEAD + RISE.replace("12;0.0240", "11;0.0240"), remove_toe=False)
    assert read.curve.time.size == 29
    assert "1 rows whose time does not increase were left out." in read.report.sentences
    with pytest.raises(InputError, match="time stands still or runs back in 29 of 30 rows"):
        record(HEAD + "\n".join("5;" + row.split(";", 1)[1] for row in RISE.splitlines()))


def test_a_clock_that_passes_midnight_runs_on(record):
    rows = [f"{(86390 + 2 * i) % 86400}" for i in range(30)]
    clock = [f"{int(s) // 3600}:{int(s) // 60 % 60:02d}:{int(s) % 60:02d}" for s in rows]
    text = "".join(f"{t};{row.split(';', 1)[1]}\n" for t, row in zip(clock, RISE.splitlines(), strict=True))
    assert np.allclose(np.diff(record(HEAD + text, remove_toe=False).curve.time), 2, rtol=0, atol=1e-9)  # seconds


def test_without_time_the_rate_gives_it(record):
    text = "CMOD [mm];Load [kN]\n" + "".join(row.split(";", 1)[1] + "\n" for row in RISE.splitlines())
    with pytest.raises(InputError, match="has no column for time: state the CMOD rate"):
        record(text)
    curve = record(text, cmod_rate=0.001 * MM, remove_toe=False).curve
    assert np.allclose(curve.time, 2.0 * np.arange(30), rtol=1e-12)  # 0.002 mm a row


def test_what_is_not_recognised_is_asked_for(record):
    text = RISE.replace(";", ",")
    with pytest.raises(InputError, match="no column was recognised as cmod or load: name the columns"):
        record(text)
    curve = record(text, columns={"time": 1, "cmod": 2, "load": 3}, units={"load": "kN"}, remove_toe=False).curve
    assert curve.load.max() == pytest.approx(2000, rel=1e-12)  # kN to N


def test_an_envelope_gives_its_middle_and_a_quarter_of_its_width(record):
    rows = "".join(f"{0.001 * i},{10 * i},{14 * i}\n" for i in range(1, 20))
    read = record("cmod, load_min, load_max\n" + rows, cmod_rate=1e-6)
    i = np.arange(1, 20)
    assert read.report.envelope
    assert np.allclose(read.curve.load, 12 * i, rtol=1e-12)  # closed form
    assert np.allclose(read.curve.load_std, i, rtol=1e-12)  # half width 2i, halved
    assert read.load_std == pytest.approx(np.sqrt(np.mean(i**2.0)), rel=1e-12)  # root mean square
    assert np.allclose(read.curve.time, i, rtol=1e-12)  # 1 µm a second


@pytest.fixture
def gregoire(shared_data):
    """Half-notched concrete beam, Grégoire, Rojas-Solano, Pijaudier-Cabot (2013)."""
    return shared_data / "concrete_cmod_pypd" / "half_notched_beam.csv"


@pytest.mark.parametrize(
    ("column", "peak", "at", "area"), [("load_min", 932.8, 0.018, 85.8), ("load_max", 1113.9, 0.023, 134.9)]
)
def test_bounds_of_the_measured_beam_have_their_published_peak_and_area(gregoire, column, peak, at, area):
    curve = read_record(gregoire, cmod_rate=1e-7, columns={"load": column}, remove_toe=False).curve
    assert curve.load.max() == pytest.approx(peak, abs=0.05)  # printed to 0.1 N
    # the parabola through the flat top lies below the largest single reading by less than 0.3 %
    assert curve.peak()[1] == pytest.approx(peak, rel=3e-3)
    assert curve.peak()[0] == pytest.approx(at * MM, abs=0.001 * MM)  # published as 0.018 to 0.023 mm
    assert curve.cmod.max() == pytest.approx(0.203 * MM, abs=0.0005 * MM)  # printed to 0.001 mm
    assert curve.cmod_area() * 1e3 == pytest.approx(area, abs=0.05)  # N mm, printed to 0.1


def test_the_middle_of_the_measured_beam_lies_between_its_bounds(gregoire):
    read = read_record(gregoire, cmod_rate=0.05 * MM / 60)
    assert read.report.envelope
    assert 932.8 < read.curve.peak()[1] < 1113.9
    assert read.curve.cmod_area() * 1e3 == pytest.approx((85.8 + 134.9) / 2, abs=0.05)  # the integral is linear
    secant = read.curve.load_at(np.array([0.0035 * MM]))[0] / 0.0035
    assert 74.5e3 < secant < 87.8e3  # N/mm, published secant at 0.0035 mm
    assert np.all(np.diff(read.curve.time) > 0)
