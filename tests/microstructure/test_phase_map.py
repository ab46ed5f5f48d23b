"""Label images: read as they are, stones numbered, small ones given to the mastic."""

import cv2
import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.microstructure.phase_map import from_labels
from pipeline.microstructure.placement import ImagePlacement

PLACEMENT = ImagePlacement(0.1e-3, (50.0, 150.0))


def labels(*disks):
    """Mastic with an outer frame, and disks (column, row, radius) of aggregate."""
    image = np.ones((200, 300), np.uint8)
    image[:, :10] = Phase.OUTSIDE
    for column, row, radius in disks:
        cv2.circle(image, (column, row), radius, int(Phase.AGGREGATE), -1)
    return image


def test_points_find_the_nearest_pixel():
    image = labels((100, 100, 30))
    image[20, 20] = Phase.VOID
    phase_map, _ = from_labels(image, PLACEMENT)
    pixels = np.array([[100.0, 100.0], [20.49, 20.49], [20.51, 20], [5, 50], [299.49, 100], [299.51, 100], [-0.6, 0]])
    phase, stone = phase_map.at(PLACEMENT.to_specimen(pixels))
    assert phase.tolist() == [Phase.AGGREGATE, Phase.VOID, Phase.MASTIC, Phase.OUTSIDE, Phase.MASTIC, 0, 0]
    assert stone.tolist() == [1, 0, 0, 0, 0, 0, 0]


def test_small_stones_are_mastic_and_touching_ones_two():
    image = labels(
        (60, 60, 11), (100, 130, 12), (200, 80, 30), (255, 80, 27)
    )  # 2.2 mm, 2.4 mm, a pair 2 px into each other
    phase_map, stones = from_labels(image, PLACEMENT)
    assert (stones.count, stones.split, stones.small) == (3, 1, 1)
    assert phase_map.stones == 3
    phase, stone = phase_map.at(PLACEMENT.to_specimen(np.array([[60, 60], [100, 130], [200, 80], [255, 80]])))
    assert phase.tolist() == [Phase.MASTIC] + 3 * [Phase.AGGREGATE]
    assert len(set(stone[1:].tolist())) == 3
    assert ((phase_map.stone > 0) == (phase_map.label == Phase.AGGREGATE)).all()
    material = np.count_nonzero(image != Phase.OUTSIDE)
    assert phase_map.share(Phase.AGGREGATE) == np.count_nonzero(phase_map.stone) / material


@pytest.mark.parametrize(
    ("image", "word"),
    [
        (np.array([[1, 2], [4, 255]], np.uint8), r"the values 4, 255: only 0 outside"),
        (np.ones((4, 4, 3), np.uint8), "one channel"),
        (np.ones((4, 4)), "whole numbers"),
        (np.array([[0, 3]], np.uint8), "no material"),
        (np.arange(256, dtype=np.uint8).reshape(16, 16), "and 244 more"),
    ],
)
def test_other_images_are_refused(image, word):
    with pytest.raises(InputError, match=word):
        from_labels(image, PLACEMENT)
