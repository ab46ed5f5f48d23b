"""Correlated frames on disk: what was written comes back, what cannot be trusted does not."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.frames import cracked_result, frame_of

from pipeline.core.errors import StoreError
from pipeline.store.correlations import FrameStore, as_kept, chained_keys


@pytest.fixture
def store(tmp_path):
    return FrameStore(tmp_path / "frames")


def same(one, two):
    assert (one.number, one.base, one.sound, one.seconds) == (two.number, two.base, two.sound, two.seconds)
    for name, value in vars(as_kept(two.result)).items():
        if name == "grid":
            np.testing.assert_array_equal(one.result.grid.points, value.points)
        elif name not in ("valid", "split"):  # computed from the others
            np.testing.assert_array_equal(getattr(one.result, name), value)


@pytest.mark.parametrize("number", [1, 7])
def test_a_frame_comes_back(store, number):
    frame = frame_of(number, cracked_result())
    store.put("k", frame)
    back = store.get(number, "k")
    same(back, frame)
    np.testing.assert_allclose(back.crack.path, frame.crack.path)
    assert (back.crack.through, back.crack.tip_std) == (frame.crack.through, frame.crack.tip_std)


def test_rounding_twice_is_rounding_once():
    once = as_kept(cracked_result())
    np.testing.assert_array_equal(as_kept(once).warp, once.warp)
    np.testing.assert_allclose(once.warp, cracked_result().warp, rtol=6e-8)  # single precision


def test_a_frame_without_a_crack_comes_back(store):
    frame = frame_of(1, cracked_result(), crack=False)
    store.put("k", frame)
    assert store.get(1, "k").crack is None


def test_another_key_is_another_frame(store):
    store.put("k", frame_of(1, cracked_result()))
    assert store.get(1, "other") is None
    assert store.get(2, "k") is None
    with pytest.raises(StoreError, match="give the same command again"):
        store.need(2, "k")


@pytest.mark.parametrize("spoil", [lambda b: b[:500], lambda b: b"", lambda b: b[:-2000] + bytes(2000)])
def test_a_damaged_file_is_moved_aside(store, spoil):
    for number in (1, 2):
        store.put("k", frame_of(number, cracked_result()))
    path = store.path(2)
    path.write_bytes(spoil(path.read_bytes()))
    assert store.get(2, "k") is None
    assert path.with_suffix(".h5.damaged").exists()
    assert store.kept(["a", "k", "k"]) == 1


def test_what_is_kept_ends_at_the_first_gap(store):
    keys = ["a", "b", "c", "d"]
    assert store.kept(keys) == 0
    for number in (1, 3):
        store.put(keys[number], frame_of(number, cracked_result()))
    assert store.kept(keys) == 1
    store.put("c", frame_of(2, cracked_result()))
    assert store.kept(keys) == 3
    assert store.kept(["a", "b", "x", "y"]) == 1


def test_keys_follow_the_bytes_of_all_images_before(tmp_path):
    images = [tmp_path / f"{k}.png" for k in range(4)]
    for k, image in enumerate(images):
        image.write_bytes(bytes([k]) * 10)
    keys = chained_keys("settings", images)
    assert len(set(keys)) == 4
    assert chained_keys("settings", images[:3]) == keys[:3]  # a series that grows keeps its keys
    images[2].write_bytes(b"another")
    changed = chained_keys("settings", images)
    assert (changed[:2], changed[2] != keys[2], changed[3] != keys[3]) == (keys[:2], True, True)
    assert chained_keys("others", images)[0] != keys[0]
    images[1].unlink()
    with pytest.raises(StoreError, match=r"1\.png"):
        chained_keys("settings", images)
