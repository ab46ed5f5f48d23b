"""Photographs to phases: drawn ones whose truth is known, and neutron tomographs of concrete."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import tifffile

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.microstructure.convexity import AggregateIs
from pipeline.microstructure.placement import ImagePlacement
from pipeline.microstructure.segment import SegmentSettings, segment

from .photograph import draw

PLACEMENT = ImagePlacement(1e-4, (400.0, 390.0))


def large_stones(stone, smallest_px):
    """How many connected pieces of true stones (cut by the edges) are larger than the smallest stone."""
    stats = [cv2.connectedComponentsWithStats((stone == k).astype(np.uint8))[2] for k in range(1, stone.max() + 1)]
    return sum(int((s[1:, cv2.CC_STAT_AREA] >= np.pi / 4 * smallest_px**2).sum()) for s in stats)


@pytest.mark.parametrize(
    ("seed", "aggregate", "mastic", "noise", "light"),
    [
        (1, 70, 150, 0, 0.0),
        (2, 70, 150, 8, 0.4),
        (3, 150, 70, 0, 0.0),
        (4, 150, 70, 8, 0.4),
        (5, 110, 150, 4, 0.2),
        (6, 150, 70, 20, 0.2),
    ],
)
def test_drawn_photographs_are_read_as_they_were_drawn(seed, aggregate, mastic, noise, light):
    drawn = draw(seed, aggregate, mastic, noise, light)
    found = segment(drawn.image, PLACEMENT)
    assert found.aggregate_is == (AggregateIs.DARK if aggregate < mastic else AggregateIs.BRIGHT)
    truth, label = drawn.stone > 0, found.phase_map.label
    # pieces below 2.36 mm (cut by the edges, or at the end of Fuller's curve) go to the mastic: measured 0.003 to 0.014
    assert found.aggregate_fraction == pytest.approx(truth.mean(), abs=0.02)
    assert np.mean((label == Phase.AGGREGATE) != truth) < 0.03  # half a pixel of outline is 0.015
    assert found.void_fraction == 0
    assert found.void_threshold is None
    assert found.stones == pytest.approx(large_stones(drawn.stone, 23.6), rel=0.06)  # sizes at the limit go either way


def test_voids_are_found_and_left_open():
    drawn = draw(7, aggregate=150, mastic=80, noise=5, light=0.2, voids=40)
    found = segment(drawn.image, PLACEMENT)
    void = found.phase_map.label == Phase.VOID
    assert found.void_fraction == pytest.approx(drawn.void.mean(), rel=0.1)  # half a pixel on a radius of 10 is 10 %
    assert np.count_nonzero(void & drawn.void) > 0.9 * np.count_nonzero(void | drawn.void)


def test_voids_that_are_the_largest_contrast_are_not_taken_for_a_phase():
    drawn = draw(13, aggregate=190, mastic=140, noise=4, light=0.1, voids=60)
    found = segment(drawn.image, PLACEMENT)
    assert found.aggregate_is == AggregateIs.BRIGHT
    assert found.void_fraction == pytest.approx(drawn.void.mean(), rel=0.1)  # as above
    assert found.aggregate_fraction == pytest.approx((drawn.stone > 0).mean(), abs=0.02)


def test_voids_among_dark_stones_are_found_too():
    drawn = draw(8, aggregate=80, mastic=160, noise=5, light=0.2, voids=40)
    found = segment(drawn.image, PLACEMENT)
    void = found.phase_map.label == Phase.VOID
    # the rim between void and mastic passes through the grey of the stones: voids come out a pixel smaller
    assert np.count_nonzero(void & drawn.void) > 0.75 * np.count_nonzero(void | drawn.void)
    assert found.aggregate_is == AggregateIs.DARK
    assert found.aggregate_fraction == pytest.approx((drawn.stone > 0).mean(), abs=0.02)


def test_result_does_not_depend_on_depth_gain_or_colour():
    drawn = draw(9)
    grey = segment(drawn.image, PLACEMENT)
    deep = segment(drawn.image.astype(np.uint16) * 200, PLACEMENT)
    colour = segment(np.repeat(drawn.image[..., None], 3, axis=2), PLACEMENT)
    for other in (deep, colour):
        assert np.mean(other.phase_map.label != grey.phase_map.label) < 1e-3  # rounding of the threshold's histogram
    assert deep.threshold == pytest.approx(200 * grey.threshold, rel=1e-2)  # as above


def test_light_is_not_taken_for_stones():
    """Brighter by a factor of three from corner to corner; all stones in one half, none in the other."""
    drawn = draw(10, light=0.0, noise=3)
    half = np.where(np.arange(drawn.stone.shape[1]) < 400, drawn.stone, 0)
    image = np.where(half > 0, drawn.image, 150)
    y, x = np.mgrid[-1 : 1 : image.shape[0] * 1j, -1 : 1 : image.shape[1] * 1j]
    lit = np.clip(image * (1 + 0.3 * x + 0.2 * y), 0, 255).astype(np.uint8)
    found = segment(lit, PLACEMENT)
    assert np.mean((found.phase_map.label == Phase.AGGREGATE) != (half > 0)) < 0.03  # as for even light


def test_outside_the_mask_nothing_is_read_and_its_edge_is_kept():
    drawn = draw(11)
    mask = np.zeros(drawn.image.shape, bool)
    mask[50:350, 100:700] = True
    image = np.where(mask, drawn.image, 3).astype(np.uint8)
    found = segment(image, PLACEMENT, mask=mask)
    label = found.phase_map.label
    assert (label[48] == Phase.OUTSIDE).all()
    assert (label[:, 702] == Phase.OUTSIDE).all()
    assert (label[49:351, 99:701] != Phase.OUTSIDE).all()  # one pixel more, for points at the very edge
    assert np.mean((label == Phase.AGGREGATE)[mask] != (drawn.stone > 0)[mask]) < 0.03  # as without a mask
    assert found.void_fraction == 0
    alone = segment(drawn.image[50:350, 100:700], PLACEMENT)
    assert np.mean(alone.phase_map.label != label[50:350, 100:700]) < 2e-3  # the background does not bleed in


def test_aggregate_is_can_be_said():
    drawn = draw(12)
    dark, bright = (segment(drawn.image, PLACEMENT, SegmentSettings(aggregate_is=a)) for a in ("dark", "bright"))
    assert dark.aggregate_is == AggregateIs.DARK
    assert dark.convex_lead == pytest.approx(-bright.convex_lead)
    assert bright.thresholded_fraction == pytest.approx(1 - dark.thresholded_fraction, abs=1e-12)


def test_specks_and_holes_are_cleaned():
    image = np.full((500, 1000), 150, np.uint8)
    for column, grain in ((100, 2), (300, 4), (500, 12)):
        cv2.circle(image, (column, 250), 60, 60, -1)
        cv2.circle(image, (column, 250), grain, 150, -1)  # bright grains of 0.4, 0.8 and 2.4 mm; up to 1.18 is filled
    cv2.circle(image, (180, 60), 9, 60, -1)  # a stone of 1.9 mm
    found = segment(image, PLACEMENT)
    assert (found.stones, found.small) == (3, 1)
    assert found.phase_map.label[250, [100, 300, 500]].tolist() == [Phase.AGGREGATE, Phase.AGGREGATE, Phase.MASTIC]
    assert found.phase_map.label[60, 180] == Phase.MASTIC


@pytest.mark.parametrize(
    ("image", "word"),
    [
        (np.zeros((100, 100)), "8 or 16 bit"),
        (np.zeros((100, 100, 2), np.uint8), "grey or colour"),
        (np.full((100, 100), 90, np.uint8), "blank"),
        (np.random.default_rng(0).normal(120, 10, (400, 400)).astype(np.uint8), "one population"),
        ((np.add.outer(np.arange(400), np.arange(400)) / 4).astype(np.uint8), "one population"),
    ],
)
def test_images_without_phases_are_refused(image, word):
    with pytest.raises(InputError, match=word):
        segment(image, PLACEMENT)


def test_an_image_of_specks_has_no_aggregate():
    rng = np.random.default_rng(0)
    image = np.full((400, 400), 150, np.uint8)
    for column, row in rng.integers(10, 390, (150, 2)):
        cv2.circle(image, (int(column), int(row)), 6, 60, -1)
    with pytest.raises(InputError, match=r"no aggregate of at least 2\.36 mm"):
        segment(image, PLACEMENT)


def test_stripes_have_no_round_side():
    image = np.where(np.arange(600) % 80 < 40, 60, 150).astype(np.uint8) * np.ones((400, 1), np.uint8)
    with pytest.raises(InputError, match="equally round"):
        segment(image, PLACEMENT)


def test_a_mask_must_fit():
    with pytest.raises(InputError, match="mask"):
        segment(draw(1).image, PLACEMENT, mask=np.ones((3, 3), bool))


@pytest.fixture(scope="module")
def neutron(shared_data):
    return tifffile.imread(shared_data / "concrete_ct_spam" / "concrete_neutron-bin16.tif")


CYLINDER = np.hypot(*(np.indices((100, 100)) - np.array([50, 49])[:, None, None])) < 36
RAW = SegmentSettings(aggregate_is=AggregateIs.DARK, smallest_stone=1e-4, noise=0, hole=0, neck=0, light_degree=0)


@pytest.mark.parametrize(
    ("z", "threshold", "fraction", "blobs", "larger"),
    [(25, 41761, 0.364, 67, 49), (50, 40797, 0.385, 58, 43), (75, 40711, 0.411, 57, 42)],
)
def test_plain_threshold_of_concrete_is_that_of_another_program(neutron, z, threshold, fraction, blobs, larger):
    found = segment(neutron[z], PLACEMENT, RAW, CYLINDER)
    assert found.threshold == pytest.approx(threshold, abs=(65535 - 2866) / 256)  # that program's histogram class
    assert found.thresholded_fraction == pytest.approx(fraction, abs=0.007)  # pixels within one histogram class
    assert found.stones == pytest.approx(blobs, abs=2)  # as above
    coarse = segment(neutron[z], PLACEMENT, replace(RAW, smallest_stone=np.sqrt(4 * 4.5 / np.pi) * 1e-4), CYLINDER)
    assert coarse.stones == pytest.approx(larger, abs=2)  # larger than 4 px


@pytest.mark.parametrize("z", range(15, 88, 8))
def test_concrete_is_read_without_being_told(neutron, z):
    found = segment(neutron[z], PLACEMENT, SegmentSettings(smallest_stone=4e-4), CYLINDER)
    assert found.aggregate_is == AggregateIs.DARK
    plain = segment(neutron[z], PLACEMENT, RAW, CYLINDER)
    assert found.thresholded_fraction == pytest.approx(
        plain.thresholded_fraction, abs=0.015
    )  # the cylinder is evenly lit
    assert 0.25 < found.aggregate_fraction < plain.thresholded_fraction  # small blobs are mortar
    assert found.split < 0.15 * found.stones
