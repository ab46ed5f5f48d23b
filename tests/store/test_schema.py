"""Layouts: identity of writing and reading, and what does not fit is named."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import MissingFileError, StoreError
from pipeline.store import layouts
from pipeline.store.schema import LONGEST, Entry, Layout

LAYOUT = Layout(
    "example",
    (
        Entry("note", None, "1", "a remark", "str"),
        Entry("count", None, "1", "a number", "int64"),
        Entry("a/x", ("n",), "m", "positions"),
        Entry("a/y", ("n", 2), "m", "pairs", "float32"),
        Entry("b", (), "m", "scalar or one a position", also=(("n",),)),
        Entry("flag", ("n",), "1", "marks", "bool", optional=True),
    ),
)


def values(n: int = 5, **changes):
    random = np.random.default_rng(n)
    plain = {
        "note": "Größe",
        "count": 3,
        "a/x": random.normal(size=n),
        "a/y": random.normal(size=(n, 2)),
        "b": 1.5,
        "flag": random.integers(0, 2, n) == 1,
    }
    return plain | changes


@pytest.fixture
def path(tmp_path):
    (tmp_path / "x.h5").write_bytes(LAYOUT.encode(values()))
    return tmp_path / "x.h5"


@settings(max_examples=40)
@given(st.integers(0, 40), st.booleans(), st.booleans())
def test_write_then_read_is_the_identity(tmp_path_factory, n, with_flag, long):
    given_values = values(n, b=np.arange(n) * 0.5 if long else 2.5, **({} if with_flag else {"flag": None}))
    path = tmp_path_factory.mktemp("h5") / "x.h5"
    path.write_bytes(LAYOUT.encode(given_values))
    read = LAYOUT.decode(path)
    for entry in LAYOUT.entries:
        want = given_values[entry.name]
        if want is None:
            assert read[entry.name] is None
        else:
            assert np.array_equal(read[entry.name], np.asarray(want, entry.dtype if entry.dtype != "str" else None))


def test_same_values_give_the_same_bytes():
    assert LAYOUT.encode(values()) == LAYOUT.encode(values())


def test_units_and_format_stand_in_the_file(path):
    with h5py.File(path) as file:
        assert file["a/x"].attrs["unit"] == "m"
        assert file.attrs["format"] == 1


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"a/x": None}, "a/x is missing (positions)"),
        ({"note": None}, "note is missing"),
        ({"a/y": np.zeros((4, 2))}, "a/y has shape (4, 2), it must be (n, 2) with n = 5 as in a/x"),
        ({"a/y": np.zeros((5, 3))}, "a/y has shape (5, 3), it must be (n, 2)"),
        ({"a/x": np.zeros((5, 2))}, "a/x has shape (5, 2), it must be (n,)"),
        ({"b": np.zeros(4)}, "b has shape (4,), it must be () or (n,)"),
        ({"c": 1}, "['c'] is not in the layout"),
    ],
)
def test_what_does_not_fit_is_not_written(changes, sentence):
    with pytest.raises(StoreError) as error:
        LAYOUT.encode(values(**changes))
    assert sentence in str(error.value)


def test_files_of_others_are_checked_and_everything_is_named(path):
    with h5py.File(path, "a") as file:
        del file["a/x"], file.attrs["count"]
        file["a/x"] = np.array(["p", "q"], "S1")
        file.attrs["format"] = 2
        del file["b"]
        file.create_group("b")
    with pytest.raises(StoreError) as error:
        LAYOUT.decode(path)
    assert str(error.value).split("\n") == [
        "x.h5: attribute format must be 1",
        "x.h5: count is missing (a number)",
        "x.h5: a/x holds |S1, it must hold float64",
        "x.h5: b must be a dataset",
    ]


@pytest.mark.parametrize("tenth", range(10))
def test_a_truncated_file_is_seen(path, tenth):
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * tenth // 10])
    with pytest.raises(StoreError, match=r"x\.h5: it is (truncated|no readable HDF5 file)"):
        LAYOUT.decode(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MissingFileError, match=r"x\.h5 does not exist"):
        LAYOUT.decode(tmp_path / "x.h5")


@settings(max_examples=100)
@given(st.data())
def test_a_changed_bit_never_changes_an_array(tmp_path_factory, data):
    """Chunks carry check sums and so do the file's structures: arrays are either right or refused."""
    path = tmp_path_factory.mktemp("bits") / "x.h5"
    content = bytearray(LAYOUT.encode(values()))
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content)
    try:
        read = LAYOUT.decode(path)
    except StoreError:
        return
    for name in ("a/x", "a/y", "flag"):
        entry = next(e for e in LAYOUT.entries if e.name == name)
        assert np.array_equal(read[name], np.asarray(values()[name], entry.dtype)), at


def test_texts_are_kept_with_a_fixed_length(path):
    """Of a heap, where HDF5 keeps others, it reads an object whose size a changed bit has made zero for ever."""
    with h5py.File(path) as file:
        assert h5py.check_string_dtype(file.attrs.get_id("note").dtype).length == len("Größe".encode())
    assert LAYOUT.decode(path)["note"] == "Größe"


def test_a_text_that_no_attribute_holds_is_refused():
    with pytest.raises(StoreError, match="note has more than 60000 bytes"):
        LAYOUT.encode({**values(), "note": "x" * 70_000})
    assert LAYOUT.encode({**values(), "note": "x" * LONGEST})


def test_texts_of_variable_length_are_read(path):
    with h5py.File(path, "r+") as file:
        file.attrs["note"] = "Größe"
    assert LAYOUT.decode(path)["note"] == "Größe"


def test_the_table_is_made_from_the_layout():
    rows = LAYOUT.table().splitlines()
    assert rows[2] == "| `note` | attribute, str | 1 | a remark |"
    assert rows[6] == "| `b` | float64 () or (n,) | m | scalar or one a position |"
    assert rows[7] == "| `flag` | bool (n,), optional | 1 | marks |"


@pytest.mark.parametrize("layout", [layouts.FIELDS, layouts.SIMULATION, layouts.SIMULATE, layouts.IDENTIFY])
def test_every_layout_names_each_entry_once_with_a_unit_that_fits_its_name(layout):
    names = [entry.name for entry in layout.entries]
    assert len(set(names)) == len(names)
    for entry in layout.entries:
        last = entry.name.rsplit("_", 1)[-1]
        if last in ("m", "n", "s", "j", "mm"):
            assert entry.unit == {"m": "m", "n": "N", "s": "s", "j": "J", "mm": "mm"}[last], entry.name


TEXTS = Layout("texts", (Entry("name", ("n",), "1", "names", "str"), Entry("x", ("n",), "m", "numbers")))


@settings(max_examples=40)
@given(st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12), max_size=6))
def test_rows_of_text_are_kept(tmp_path_factory, texts):
    path = tmp_path_factory.mktemp("h5") / "x.h5"
    path.write_bytes(TEXTS.encode({"name": texts, "x": np.zeros(len(texts))}))
    assert TEXTS.decode(path)["name"].tolist() == texts


def test_text_where_numbers_belong_and_the_other_way_are_refused(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file.attrs["format"] = 1
        file["name"], file["x"] = np.zeros(2), np.array([b"a", b"b"])
    with pytest.raises(StoreError, match="name holds float64, it must hold str") as error:
        TEXTS.decode(tmp_path / "x.h5")
    assert "it must hold float64" in str(error.value)
