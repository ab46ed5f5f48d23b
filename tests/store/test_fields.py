"""fields.h5: the contract of bundle.md, ours and others'."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import StoreError
from pipeline.core.field import DisplacementField
from pipeline.core.units import MM
from pipeline.store.fields import field_problems, read_fields, stream_fields, write_fields


def random_field(frames: int, n: int, spread: str) -> DisplacementField:
    random = np.random.default_rng(frames * 100 + n)
    shape = (frames, n)
    std = {
        "one": np.full(shape, 2e-7),
        "points": np.broadcast_to(random.uniform(1e-7, 1e-6, n), shape),
        "all": random.uniform(1e-7, 1e-6, shape),
    }[spread]
    return DisplacementField(
        random.normal(scale=0.01, size=(n, 2)),
        random.normal(scale=1e-5, size=(*shape, 2)),
        random.integers(0, 2, shape) == 1,
        std,
        np.cumsum(random.uniform(0.1, 1, frames)),
    )


@settings(max_examples=40)
@given(st.integers(1, 6), st.integers(1, 8), st.sampled_from(["one", "points", "all"]))
def test_write_then_read_is_the_identity(tmp_path_factory, frames, n, spread):
    path = tmp_path_factory.mktemp("fields") / "fields.h5"
    field = random_field(frames, n, spread)
    write_fields(path, field)
    read = read_fields(path)
    for name in ("points", "displacement", "std"):
        assert np.allclose(getattr(read, name), getattr(field, name), rtol=1e-15, atol=0)  # m → mm → m
    assert np.array_equal(read.valid, field.valid)
    assert np.array_equal(read.abscissa, field.abscissa)


def by_frames(field):
    return zip(field.displacement, field.valid, field.std, strict=True)


def test_frame_by_frame_is_the_same_as_at_once(tmp_path):
    field = random_field(5, 300, "all")
    stream_fields(tmp_path / "streamed.h5", field.points, field.abscissa, by_frames(field))
    write_fields(tmp_path / "whole.h5", field)
    streamed, whole = (read_fields(tmp_path / name) for name in ("streamed.h5", "whole.h5"))
    for name in ("points", "displacement", "std", "valid", "abscissa"):
        np.testing.assert_array_equal(getattr(streamed, name), getattr(whole, name))


def test_one_frame_at_a_time_is_in_memory(tmp_path):
    n, frames, alive = 20000, 40, []

    def told():
        for _ in range(frames):
            alive.append(1)
            yield np.zeros((n, 2)), np.ones(n, bool), np.zeros(n)

    tracemalloc.start()
    stream_fields(tmp_path / "f.h5", np.random.default_rng(0).random((n, 2)), np.arange(frames, dtype=float), told())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(alive) == frames
    assert peak < 8 * n * 24  # bytes; all 40 frames would be 40 n 25


@pytest.mark.parametrize("count", [2, 4])
def test_a_series_that_stops_early_leaves_the_old_file(tmp_path, count):
    field, path = random_field(3, 10, "all"), tmp_path / "fields.h5"
    write_fields(path, field)
    before = path.read_bytes()
    with pytest.raises(StoreError, match="frames came"):
        stream_fields(path, field.points, np.arange(count, dtype=float), by_frames(field))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["fields.h5"]


@pytest.fixture
def path(tmp_path):
    """A file as another program would write it: plain h5py, in mm."""
    with h5py.File(tmp_path / "fields.h5", "w") as file:
        file.attrs["format"] = 1
        file["points"] = np.array([[0.0, 15.0], [1.0, 16.0], [2.0, 17.0]])
        file["displacement"] = np.arange(12.0).reshape(2, 3, 2) * 1e-3
        file["time_s"] = np.array([0.0, 5.0])
        file["valid"] = np.ones((2, 3), bool)
        file["std_mm"] = 2e-4
    return tmp_path / "fields.h5"


def change(path, name, value):
    with h5py.File(path, "a") as file:
        del file[name]
        if value is not None:
            file[name] = value


def test_reads_millimetres_into_metres(path):
    field = read_fields(path)
    assert np.allclose(field.points[1], [1e-3, 16e-3], rtol=1e-15)  # one product
    assert field.displacement[1, 2, 1] == pytest.approx(11e-6, rel=1e-15)  # one product
    assert np.allclose(field.std, 2e-7, rtol=1e-15)  # one product
    assert field.abscissa.tolist() == [0, 5]


@pytest.mark.parametrize("std", [2e-4, np.full(3, 2e-4), np.full((2, 3), 2e-4)])
def test_the_scatter_may_be_one_number_or_many(path, std):
    change(path, "std_mm", std)
    assert read_fields(path).std.shape == (2, 3)


def test_marks_may_be_small_integers(path):
    change(path, "valid", np.array([[1, 0, 1], [1, 1, 0]], np.uint8))
    assert read_fields(path).valid.tolist() == [[True, False, True], [True, True, False]]


def test_rows_with_nan_are_invalid(path):
    displacement = np.ones((2, 3, 2))
    displacement[0, 1, 0] = np.nan
    change(path, "displacement", displacement)
    change(path, "std_mm", np.array([2e-4, 2e-4, np.nan]))
    assert read_fields(path).valid.tolist() == [[True, False, False], [True, True, False]]


def test_without_a_scatter_the_given_one_stands_in(path):
    change(path, "std_mm", None)
    with pytest.raises(StoreError, match="std_mm is missing: write it, or give"):
        read_fields(path)
    assert np.all(read_fields(path, default_std=3e-7).std == 3e-7)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("displacement", np.zeros((2, 4, 2)), "displacement has shape (2, 4, 2), it must be (frames, n, 2) with n = 3"),
        ("displacement", None, "displacement is missing"),
        ("points", np.zeros((3, 3)), "points has shape (3, 3), it must be (n, 2)"),
        ("points", np.full((3, 2), np.nan), "points holds NaN"),
        ("time_s", np.array([5.0, 0.0]), "time_s does not increase at frame 1"),
        ("time_s", np.array([0.0, np.nan]), "time_s holds NaN"),
        ("time_s", np.zeros(3), "time_s has shape (3,)"),
        ("valid", np.ones((3, 2), bool), "valid has shape (3, 2)"),
        ("valid", np.ones((2, 3)), "valid holds float64, it must hold bool"),
        ("std_mm", -1.0, "std_mm is negative"),
        ("std_mm", np.ones(2), "std_mm has shape (2,), it must be () or (n,) or (frames, n)"),
    ],
)
def test_what_breaks_the_contract_is_named(path, name, value, sentence):
    change(path, name, value)
    assert any(p.startswith("fields.h5: ") and sentence in p for p in field_problems(path))
    with pytest.raises(StoreError):
        read_fields(path)


def test_damaged_foreign_and_missing_files_are_named(path, tmp_path):
    content = path.read_bytes()
    for tenth in range(10):
        path.write_bytes(content[: len(content) * tenth // 10])
        with pytest.raises(StoreError, match=r"^fields\.h5: it is"):
            read_fields(path)
    (tmp_path / "text.h5").write_text("time_s,cmod_mm")
    assert "no readable HDF5 file" in field_problems(tmp_path / "text.h5")[0]
    with pytest.raises(StoreError, match="does not exist"):
        read_fields(tmp_path / "none.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = 1
    assert any("attribute format must be 1" in p for p in field_problems(tmp_path / "other.h5"))


def test_empty_series_are_refused(path, field, tmp_path):
    empty = replace(
        field,
        displacement=field.displacement[:0],
        valid=field.valid[:0],
        std=field.std[:0],
        abscissa=field.abscissa[:0],
    )
    write_fields(tmp_path / "empty.h5", empty)
    assert field_problems(tmp_path / "empty.h5") == ["empty.h5: holds no frame or no point: nothing can be compared"]


def test_units_are_millimetres_in_the_file(path, field, tmp_path):
    write_fields(tmp_path / "ours.h5", field)
    with h5py.File(tmp_path / "ours.h5") as file:
        assert np.allclose(file["points"][()] * MM, field.points, rtol=1e-15)  # one product
        assert file["points"].attrs["unit"] == "mm"
        assert file["std_mm"].shape == ()
