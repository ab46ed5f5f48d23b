"""Whole-pixel search."""

import numpy as np
import pytest

from pipeline.dic.motion import Affine
from pipeline.dic.seeds import find
from pipeline.dic.speckle import photograph_pair


@pytest.mark.parametrize("shift", [(0, 0), (37, -52), (-60, 60)])
def test_the_shift_is_found(shift):
    pair = photograph_pair(Affine((float(shift[0]), float(shift[1]))), (260, 240), 3)
    place = find(pair.reference, pair.deformed, (120, 130), 20, 64)
    assert place.shift == shift
    assert place.zncc > 0.98  # noise of 2 in a contrast of 34 grey levels: 1 − (2/34)² = 0.997
    assert place.certain


def test_zncc_is_that_of_its_definition():
    pair = photograph_pair(Affine((3.0, 1.0)), (100, 100), 4)
    place = find(pair.reference, pair.deformed, (50, 50), 10, 8)
    a, b = pair.reference[40:61, 40:61], pair.deformed[41:62, 43:64]
    assert place.zncc == pytest.approx(np.corrcoef(a.ravel(), b.ravel())[0, 1], abs=1e-9)  # Pearson


def test_strange_pictures_give_no_certain_place():
    first, second = (photograph_pair(Affine(), (200, 200), seed).reference for seed in (1, 2))
    assert not find(first, second, (100, 100), 20, 50).certain
    assert find(np.zeros((100, 100)), second, (50, 50), 10, 20) is None


def test_a_patch_at_the_border_is_cut():
    pair = photograph_pair(Affine((5.0, 6.0)), (200, 200), 5)
    assert find(pair.reference, pair.deformed, (8, 4), 20, 30).shift == (5, 6)
