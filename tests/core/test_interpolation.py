"""The weighted plane: exact for affine fields, smooth, and sure of its ground."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.core.interpolation import plane_weights


@given(seed=st.integers(0, 1000), count=st.integers(6, 40), x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5))
def test_affine_fields_are_exact(seed, count, x, y):
    rng = np.random.default_rng(seed)
    position, point = rng.uniform(-1, 1, (count, 2)), np.array([x, y])
    try:
        weight = plane_weights(position, point, 2.0)
    except InputError:
        return
    moments = weight @ np.column_stack([np.ones(count), position - point])
    np.testing.assert_allclose(moments, [1, 0, 0], atol=1e-9 * max(1, np.abs(weight).sum()))  # condition is up to 1e10


def test_a_regular_hexagon_shares_equally():
    turn = np.arange(6) * np.pi / 3
    weight = plane_weights(np.column_stack([np.cos(turn), np.sin(turn)]), np.zeros(2), 2.0)
    np.testing.assert_allclose(weight, 1 / 6, rtol=1e-13)  # by symmetry


def test_a_particle_at_the_edge_of_reach_has_no_weight():
    inner = np.array([(1.0, 0), (-1, 0), (0, 1), (0, -1)])
    with_edge = plane_weights(np.vstack([inner, [(2 - 1e-9, 0.0)]]), np.zeros(2), 2.0)
    assert abs(with_edge[-1]) < 1e-15  # (1 − d²)² with 1 − d² = 1e-9
    np.testing.assert_allclose(with_edge[:4], plane_weights(inner, np.zeros(2), 2.0), atol=1e-15)


@pytest.mark.parametrize("position", [[(0, 0), (1, 0)], [(0, 0), (0.5, 0), (1, 0), (-1, 0)], [(9, 9), (8, 9), (9, 8)]])
def test_what_spans_no_plane_is_refused(position):
    with pytest.raises(InputError, match="no plane can be fitted"):
        plane_weights(np.array(position, float), np.zeros(2), 2.0)
