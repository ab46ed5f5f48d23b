"""The library file: nothing that was kept is lost, whatever happens while it is written."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import InputError, MissingFileError, StoreError
from pipeline.store import library as module
from pipeline.store.library import Filter, Library, LibraryEntry

ENTRY = LibraryEntry(
    mixture="9.5 mm, PG 64-22 Größe",
    bundle="seb-07",
    geometry="seb",
    temperature_c=-12.0,
    thickness_mm=40.0,
    bond_area_mm2=24.0,
    cmod_rate_mm_per_min=0.5,
    f_max_n=71.0,
    delta_max_m=1.2e-4,
    f_max_95_n=(66.0, 76.0),
    delta_max_95_m=(1.1e-4, 1.3e-4),
    variance_f_max=6.0,
    covariance=-3e-6,
    variance_delta_max=2.5e-11,
    energy_j_per_m2=355.0,
    energy_95_j_per_m2=(340.0, 370.0),
    peak_load_n=2900.0,
    cmod_at_peak_mm=0.05,
    peak_load_mismatch=0.01,
    engine="equilibrium",
    objective="fields",
    version="1",
    accepted=True,
    source="results/seb-07",
    added="2026-01-01T00:00:00+00:00",
    note="first",
)


def numbered(k: int) -> LibraryEntry:
    """Another test of the mixture."""
    return replace(ENTRY, bundle=f"seb-{k:02d}", f_max_n=70.0 + k)


@pytest.fixture
def library(tmp_path):
    return Library(tmp_path / "mixtures.h5")


def test_what_was_added_is_read_back(library):
    [kept] = library.add(ENTRY)
    assert len(kept.key) == 8
    assert library.entries() == (kept,)
    assert replace(kept, key="") == ENTRY


def test_unknown_numbers_stay_unknown(library):
    library.add(replace(ENTRY, temperature_c=float("nan"), f_max_95_n=(float("nan"),) * 2, covariance=float("nan")))
    [entry] = library.entries()
    assert np.isnan([entry.temperature_c, *entry.f_max_95_n, entry.covariance]).all()


def test_entries_keep_their_order_and_are_filtered(library):
    cold = replace(numbered(3), temperature_c=-24.0, geometry="dct", mixture="other")
    first, second, third = library.add(numbered(1), numbered(2), cold)
    assert library.entries() == (first, second, third)
    assert library.entries(Filter(mixture="other")) == (third,)
    assert library.entries(Filter(geometry="seb")) == (first, second)
    assert library.entries(Filter(temperatures_c=(-30, -20))) == (third,)
    assert library.entries(Filter(key=second.key[:6])) == (second,)
    assert library.entries(Filter(mixture="none")) == ()


def test_traction_and_strength():
    assert ENTRY.traction_mpa == pytest.approx(71 / 24, rel=1e-15)  # a quotient
    assert ENTRY.strength_mpa == pytest.approx(np.sqrt(3) * 71 / 24, rel=1e-15)  # likewise
    assert ENTRY.log_covariance[0, 1] == pytest.approx(-3e-6 / (71 * 1.2e-4), rel=1e-12)  # likewise


def test_the_same_result_is_kept_once_and_of_many_all_or_none(library):
    library.add(ENTRY)
    with pytest.raises(InputError, match="holds this result of seb-07 already"):
        library.add(numbered(1), replace(ENTRY, mixture="renamed", note="again"))
    assert len(library.entries()) == 1


def test_an_entry_is_taken_out_by_the_beginning_of_its_key(library):
    first, second = library.add(numbered(1), numbered(2))
    with pytest.raises(InputError, match="must be the key of one entry"):
        library.remove("")
    with pytest.raises(InputError, match="it fits none"):
        library.remove("zz")
    assert library.remove(first.key[:7]) == first
    assert library.entries() == (second,)
    library.remove(second.key)
    assert library.entries() == ()


def test_a_library_that_is_not_there_is_named(library):
    with pytest.raises(MissingFileError, match="`cohesive-bpm library add` makes it"):
        library.entries()
    with pytest.raises(StoreError, match="does not exist"):
        Library(library.path.parent / "no-folder" / "x.h5").add(ENTRY)


def test_a_damaged_library_is_refused_and_left_as_it_is(library):
    library.add(numbered(1))
    whole = library.path.read_bytes()
    for damage in (whole[: len(whole) // 2], b"text", whole[:-1]):
        library.path.write_bytes(damage)
        with pytest.raises(StoreError, match=r"mixtures\.h5"):
            library.add(numbered(2))
        assert library.path.read_bytes() == damage


def test_no_changed_byte_is_taken_for_another_number(library):
    library.add(numbered(1), numbered(2))
    kept, whole = library.entries(), library.path.read_bytes()
    seen = 0
    for at in range(0, len(whole), max(len(whole) // 80, 1)):
        library.path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        try:
            assert library.entries() == kept  # a byte that nothing is read from
        except StoreError:
            seen += 1
    assert seen > 20


def test_a_failed_write_leaves_the_library_as_it_was(library, monkeypatch):
    library.add(numbered(1))
    before = library.path.read_bytes()

    def full(path: Path, content: bytes) -> None:
        raise StoreError(f"{path} cannot be written: the disk is full")

    monkeypatch.setattr(module, "write_atomically", full)
    with pytest.raises(StoreError, match="the disk is full"):
        library.add(numbered(2))
    assert library.path.read_bytes() == before


def test_a_file_system_without_locks_is_said_to_be_one(library, monkeypatch):
    def none(*args: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(module.fcntl, "flock", none)
    with pytest.raises(StoreError, match=r"mixtures\.h5 cannot be written: No locks available"):
        library.add(ENTRY)


def _add_many(path: Path, first: int, count: int) -> None:
    for k in range(first, first + count):
        Library(path).add(numbered(k))


def test_programs_that_add_at_the_same_time_lose_nothing(library):
    fork = multiprocessing.get_context("fork")
    workers = [fork.Process(target=_add_many, args=(library.path, 12 * k, 12)) for k in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
        assert worker.exitcode == 0
    assert sorted(entry.bundle for entry in library.entries()) == [f"seb-{k:02d}" for k in range(36)]
    assert [p.name for p in library.path.parent.iterdir()] == ["mixtures.h5"]


def _add_for_ever(path: Path) -> None:
    for k in range(100_000):
        Library(path).add(numbered(k))


@pytest.mark.parametrize("wait", [0.05, 0.11, 0.17, 0.23])
def test_a_program_killed_while_it_adds_leaves_a_whole_library_and_no_lock(library, wait):
    library.add(replace(ENTRY, bundle="before"))
    worker = multiprocessing.get_context("fork").Process(target=_add_for_ever, args=(library.path,))
    worker.start()
    while len(library.entries()) < 2:
        time.sleep(0.005)
    time.sleep(wait)
    os.kill(worker.pid, signal.SIGKILL)
    worker.join(30)
    names = [entry.bundle for entry in library.entries()]
    assert names == ["before", *(f"seb-{k:02d}" for k in range(len(names) - 1))]
    library.add(replace(ENTRY, bundle="after"))  # would wait for ever for a lock that was left
    assert library.entries()[-1].bundle == "after"
