"""The reliability diagram."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from pipeline.report.reliability import reliability

BINS = [
    {"stated": 0.35, "achieved": 0.5, "cases": 4.0, "interval_95": [0.15, 0.85]},
    {"stated": 0.95, "achieved": 0.6, "cases": 10.0, "interval_95": [0.31, 0.83]},
]


def test_points_stand_where_the_bins_are_and_carry_their_counts():
    axes = reliability(Figure().subplots(), BINS)
    diagonal, points = axes.lines[0], axes.lines[1]
    assert diagonal.get_xydata().tolist() == [[0, 0], [1, 1]]
    assert points.get_xydata() == pytest.approx(np.array([(0.35, 0.5), (0.95, 0.6)]))
    assert [t.get_text() for t in axes.texts] == ["4", "10"]
    low, high = sorted(axes.collections[0].get_segments()[1][:, 1])
    assert (low, high) == pytest.approx((0.31, 0.83))  # the interval itself, not its half width
