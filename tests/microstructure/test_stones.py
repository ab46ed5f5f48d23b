"""Splitting and numbering stones: disks of known number, and graded sections grown into each other."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.microstructure.gradation import fuller_section
from pipeline.microstructure.stones import find_stones, without_small


def disks(*spots, shape=(200, 400)):
    row, column = np.indices(shape)
    return np.any([np.hypot(column - c, row - r) <= radius for c, r, radius in spots], axis=0)


@settings(max_examples=30)
@given(first=st.integers(15, 60), ratio=st.floats(0.4, 1), share=st.floats(0, 0.6))
def test_two_disks_with_a_neck_below_the_limit_are_two(first, ratio, share):
    """Circles R, q R meeting in a chord of half length h = share × q R: distance √(R² − h²) + √(q²R² − h²)."""
    second = ratio * first
    neck = share * second
    apart = np.sqrt(first**2 - neck**2) + np.sqrt(second**2 - neck**2)
    stones = find_stones(disks((100, 100, first), (100 + apart, 100, second)), 4)
    assert stones.count == 2
    assert stones.split == (1 if neck > 1.5 else stones.split)  # a contact of a pixel may or may not join the blobs
    at = stones.number[100, [100, min(round(100 + apart), 399)]]
    assert set(at.tolist()) == {1, 2}


@settings(max_examples=30)
@given(first=st.integers(15, 60), ratio=st.floats(0.4, 1), share=st.floats(0.9, 0.99))
def test_two_disks_with_a_wide_neck_are_one(first, ratio, share):
    second = ratio * first
    neck = share * second
    apart = np.sqrt(first**2 - neck**2) + np.sqrt(second**2 - neck**2)
    assert find_stones(disks((100, 100, first), (100 + apart, 100, second)), 4).count == 1


def test_the_border_runs_along_the_neck():
    stones = find_stones(disks((100, 100, 50), (180, 100, 40)), 4)
    chord = 100 + (80**2 + 50**2 - 40**2) / (2 * 80)  # where the circles meet
    border = np.flatnonzero(np.diff(stones.number[100, 60:220].astype(int))) + 60.5
    assert border[0] == pytest.approx(chord, abs=2)  # px; the saddle of a smoothed distance of whole pixels


@pytest.mark.parametrize(("length", "width"), [(120, 40), (150, 30), (90, 60)])
@pytest.mark.parametrize("tilt", [0, 17, 45])
def test_one_long_stone_stays_one(length, width, tilt):
    mask = np.zeros((200, 400), np.uint8)
    cv2.ellipse(mask, (200, 100), (length // 2, width // 2), tilt, 0, 360, 1, -1)
    assert find_stones(mask > 0, 4).count == 1
    box = cv2.boxPoints(((200, 100), (length, width), tilt)).round().astype(np.int32)
    assert find_stones(cv2.fillPoly(np.zeros_like(mask), [box], 1) > 0, 4).count == 1


def test_grown_sections_are_split_into_their_stones():
    section = fuller_section(0.1, 0.05, 1e-4, np.random.default_rng(1))
    mask = (section.stone > 0).astype(np.uint8)
    single = cv2.connectedComponents(mask)[0] - 1  # none touches another: pieces cut by the edges count apart
    assert find_stones(mask > 0, 0).split == 0
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    grown = find_stones(cv2.dilate(mask, kernel) > 0, 0)
    assert grown.split > 0.2 * single
    assert grown.count == pytest.approx(single, rel=0.02)  # a piece at the edge may be lost in its neighbour


def test_small_ones_are_left_out_by_their_area():
    stones = find_stones(disks((60, 60, 10), (150, 60, 12), (300, 100, 40)), 22.0)
    assert (stones.count, stones.small, stones.split) == (2, 1, 0)
    assert stones.number[60, 60] == 0
    assert sorted(np.unique(stones.number)) == [0, 1, 2]


def test_no_stone_and_nothing_but_stone():
    assert find_stones(np.zeros((20, 30), bool), 4).count == 0
    assert find_stones(np.ones((20, 30), bool), 4).count == 1


def test_small_parts_of_a_mask_go():
    mask = disks((60, 60, 5), (150, 60, 12))
    assert np.array_equal(without_small(mask, 15), disks((150, 60, 12)))
