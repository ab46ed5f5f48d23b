"""Synthetic sections: area fraction, Fuller's curve, no overlap, no two alike."""

import time

import cv2
import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.microstructure.gradation import Grading, fuller_section

SIZE = (0.14, 0.062)


@pytest.fixture(scope="module")
def section():
    return fuller_section(*SIZE, 1e-4, np.random.default_rng(7))


@pytest.mark.parametrize("fraction", [0.2, 0.45, 0.6])
def test_area_fraction_is_reached(fraction):
    made = fuller_section(*SIZE, 1e-4, np.random.default_rng(1), Grading(fraction))
    stone = np.mean(made.label == Phase.AGGREGATE)
    assert stone == pytest.approx(fraction, abs=0.001)  # one smallest stone is 0.0005 of the section, the raster less
    assert np.array_equal(made.label == Phase.AGGREGATE, made.stone > 0)


def test_sizes_follow_fuller(section):
    area = np.bincount(section.stone.ravel(), minlength=section.diameter.size + 1)[1:] * section.metres_per_px**2
    diameter = np.sqrt(4 * area / np.pi)
    assert diameter == pytest.approx(
        section.diameter, rel=0.015
    )  # raster of polygons of at least 23 px; measured 0.009
    order = np.argsort(diameter)
    passing = np.cumsum(area[order]) / area.sum()
    # the coarsest stone is 1.8 % of the stones' area: the stepped curve may be off by that
    assert np.abs(passing - Grading().passing(diameter[order])).max() < 0.02
    assert diameter.min() > 2.3e-3
    assert diameter.max() < 9.6e-3


def test_passing_and_diameter_are_inverse_and_end_at_the_limits():
    grading = Grading(exponent=0.45)
    share = np.linspace(0, 1, 11)
    assert grading.passing([grading.diameter(s) for s in share]) == pytest.approx(share, abs=1e-12)  # round-off
    assert grading.passing([1e-3, 2e-2]).tolist() == [0, 1]


def test_stones_keep_their_film(section):
    """Each stone widened by the gap meets no other, also across the edges of the repeating section."""
    tiled = np.pad(section.stone, 20, mode="wrap")
    kernel = (np.hypot(*np.mgrid[-2:3, -2:3]) <= 2).astype(np.uint8)
    count = sum(
        cv2.dilate((tiled == k).astype(np.uint8), kernel).astype(np.uint16)
        for k in range(1, section.diameter.size + 1, 3)
    )
    own = np.isin(tiled, np.arange(1, section.diameter.size + 1, 3))
    assert count[own].max() == 1


def test_sections_depend_on_the_generator_only(section):
    again = fuller_section(*SIZE, 1e-4, np.random.default_rng(7))
    other = fuller_section(*SIZE, 1e-4, np.random.default_rng(8))
    assert np.array_equal(section.label, again.label)
    assert np.mean(section.label != other.label) > 0.3  # independent sections differ on 2 f (1 − f) = 0.495


def test_a_section_is_made_in_a_moment():
    start = time.process_time()
    fuller_section(*SIZE, 1e-4, np.random.default_rng(0))
    assert time.process_time() - start < 3  # s; measured 0.2


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"metres_per_px": 1e-3}, "too coarse"),
        ({"height": 0.015}, "too small"),
        ({"grading": Grading(0.93, gap=0.0)}, "area_fraction = 0.93 cannot be reached"),
    ],
)
def test_what_cannot_be_made_is_refused(arguments, word):
    given = {"width": 0.05, "height": 0.04, "metres_per_px": 1e-4, "rng": np.random.default_rng(0), **arguments}
    with pytest.raises(InputError, match=word):
        fuller_section(**given)


@pytest.mark.parametrize("wrong", [{"area_fraction": 0.0}, {"area_fraction": 1.2}, {"largest": 1e-3}, {"gap": -1e-3}])
def test_gradings_without_sense_are_refused(wrong):
    with pytest.raises(InputError):
        Grading(**wrong)
