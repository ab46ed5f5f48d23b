"""Pixels and specimen coordinates: the handbook's definition, and back again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.microstructure.placement import ImagePlacement, specimen_mask

MM = 1e-3


def test_columns_run_along_x_and_rows_against_y():
    placement = ImagePlacement(0.05 * MM, (1500.0, 1200.0))
    got = placement.to_specimen(np.array([[1500, 1200], [1520, 1200], [1500, 1180]]))
    assert got == pytest.approx(np.array([[0, 0], [1, 0], [0, 1]]) * MM, abs=1e-18)


def test_a_disk_photographed_with_its_mouth_to_the_left_is_turned_upright():
    placement = ImagePlacement(0.1 * MM, (0.0, 100.0), rotation_deg=90)
    # to the right in the image is into the specimen, +y; up in the image is to the left of the notch, −x
    got = placement.to_specimen(np.array([[50, 100], [0, 50]]))
    assert got == pytest.approx(np.array([[0, 5], [-5, 0]]) * MM, abs=1e-17)  # round-off of cos 90°


def test_the_other_face_is_reflected_about_the_notch_line():
    placement = ImagePlacement(0.1 * MM, (10.0, 20.0), rotation_deg=90)
    mirrored = ImagePlacement(0.1 * MM, (10.0, 20.0), rotation_deg=90, mirror=True)
    pixels = np.array([[3.0, 4.0], [50.0, 7.0]])
    assert mirrored.to_specimen(pixels) == pytest.approx(placement.to_specimen(pixels) * (-1, 1), abs=1e-18)


@given(
    pitch=st.floats(1e-6, 1e-3),
    origin=st.tuples(st.floats(-5000, 5000), st.floats(-5000, 5000)),
    turn=st.floats(-360, 360),
    mirror=st.booleans(),
    pixel=st.tuples(st.floats(0, 5000), st.floats(0, 5000)),
)
def test_there_and_back(pitch, origin, turn, mirror, pixel):
    placement = ImagePlacement(pitch, origin, turn, mirror)
    there = placement.to_specimen(np.array([pixel]))
    assert placement.to_pixel(there) == pytest.approx(np.array([pixel]), abs=1e-9)  # px; round-off of 10⁴ px
    assert np.hypot(*there[0]) == pytest.approx(pitch * np.hypot(*np.subtract(pixel, origin)), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("pitch", [0.0, -1e-4, float("nan"), float("inf")])
def test_a_pitch_must_be_positive(pitch):
    with pytest.raises(InputError, match="mm_per_px"):
        ImagePlacement(pitch)


def test_the_mask_is_the_specimen(disk):
    placement = ImagePlacement(0.5 * MM, (160.0, 300.0))
    mask = specimen_mask(disk, placement, (320, 320))
    assert mask[300 - 140, 160]  # ligament
    assert not mask[300 - 70, 160 + 50]  # pin hole at (25, 35) mm
    assert not mask[300 - 20, 160]  # notch of 1.5 mm
    assert not mask[310, 160]  # below the mouth
