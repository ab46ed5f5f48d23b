"""Pixels and specimen coordinates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.dic.camera import View

number = st.floats(-2000, 2000)


def test_y_points_up_and_the_origin_may_lie_outside():
    view = View(0.0439e-3, (650.0, 990.0))
    np.testing.assert_allclose(view.point([[650.0, 990.0], [750.0, 890.0]]), [[0, 0], [4.39e-3, 4.39e-3]], atol=1e-15)


def test_a_quarter_turn():
    view = View(1e-3, rotation=np.pi / 2)
    np.testing.assert_allclose(view.point([[3.0, 0.0]]), [[0.0, 3e-3]], atol=1e-15)  # counter-clockwise


def test_the_other_face_is_mirrored_in_x_last():
    plain, other = (View(1e-3, (5.0, 6.0), 0.7, mirror) for mirror in (False, True))
    np.testing.assert_allclose(other.point([[3.0, 1.0]]), plain.point([[3.0, 1.0]]) * [-1, 1], atol=1e-15)


@given(number, number, number, number, st.floats(-4, 4), st.booleans())
def test_there_and_back(column, row, c0, r0, rotation, mirror):
    view = View(0.05e-3, (c0, r0), rotation, mirror)
    np.testing.assert_allclose(view.pixel(view.point([[column, row]])), [[column, row]], atol=1e-8)  # round-off
    np.testing.assert_allclose(view.pixel_vector(view.vector([[column, row]])), [[column, row]], atol=1e-8)


def test_a_scale_must_be_positive():
    with pytest.raises(InputError, match="positive"):
        View(0.0)
