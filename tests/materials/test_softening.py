"""Shapes of softening: equal areas, known points, and the way back from damage."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from pipeline.core.errors import InputError
from pipeline.materials.softening import EXPONENTIAL_END, EXPONENTIAL_RATE, LINEAR, Shape, Softening

SHAPES = [LINEAR, Softening(Shape.EXPONENTIAL), Softening(Shape.BILINEAR_TAIL), Softening(Shape.BILINEAR_TAIL, 0.4)]


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_every_shape_has_the_area_of_the_linear_one(shape: Softening) -> None:
    corners = [shape.kink] if shape.shape is Shape.BILINEAR_TAIL else None
    area, _ = quad(lambda s: float(shape.left(s)), 0, shape.end, points=corners, epsabs=1e-13)
    assert area == pytest.approx(0.5, abs=1e-12)  # the quadrature
    assert shape.area(shape.end) == pytest.approx(0.5, abs=1e-15)  # one rounding
    for way in (0.1, 0.45, 0.9):
        part, _ = quad(lambda s: float(shape.left(s)), 0, way, points=corners, epsabs=1e-13)
        assert shape.area(way) == pytest.approx(part, abs=1e-12)  # the quadrature
    assert shape.left(0.0) == 1
    assert shape.left(shape.end) == 0
    assert shape.left(9.0) == 0


def test_points_a_reader_can_redo() -> None:
    petersson = Softening(Shape.BILINEAR_TAIL)  # in w/(2 G_f/f_t): 0.8/2 and 3.6/2
    assert petersson.kink == pytest.approx(0.4, rel=1e-15)  # one rounding
    assert petersson.end == pytest.approx(1.8, rel=1e-15)
    assert petersson.left(np.array([0.2, 0.4, 1.1])) == pytest.approx([2 / 3, 1 / 3, 1 / 6], rel=1e-14)
    ways = np.linspace(0, 1, 7)
    none = Softening(Shape.BILINEAR_TAIL, 0.0)
    assert none.left(ways) == pytest.approx(1 - ways, abs=1e-15), "tail 0 is the linear law"
    assert 1 / EXPONENTIAL_RATE - EXPONENTIAL_END / np.expm1(EXPONENTIAL_RATE * EXPONENTIAL_END) == pytest.approx(
        0.5, abs=1e-15
    )  # one rounding
    decay = Softening(Shape.EXPONENTIAL).left(np.array([0.5]))[0]
    assert decay == pytest.approx(np.exp(-0.5 * EXPONENTIAL_RATE), abs=3e-4)  # its end at s = 4 instead of infinity


@given(st.sampled_from(SHAPES), st.floats(1e-6, 0.999), st.floats(1.0001, 1e5))
def test_the_way_back_from_damage(shape: Softening, share: float, stretch: float) -> None:
    way = share * shape.end
    damage = 1 - shape.left(way) / (1 + way * (stretch - 1))
    found = shape.way_of_damage(np.array([damage]), np.array([stretch]))[0]
    again = 1 - shape.left(found) / (1 + found * (stretch - 1))
    assert again == pytest.approx(damage, abs=4e-16)  # roundings: the way itself is worse known where D is near 1
    assert shape.way_of_damage(np.array([0.0, 1.0]), np.array([stretch, stretch])) == pytest.approx([0, shape.end])


@pytest.mark.parametrize("tail", [-0.1, 1.1, np.nan])
def test_a_tail_out_of_range_is_refused(tail: float) -> None:
    with pytest.raises(InputError, match=r"tail = .* must be between 0 \(linear\) and 1 \(long tail\)"):
        Softening(Shape.BILINEAR_TAIL, tail)
