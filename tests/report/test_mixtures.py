"""Figures of identified mixtures show the numbers they were given."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from pipeline.report.mixtures import CHI2_95, against_temperature, ellipse, parameter_plane


def test_points_by_mixture_and_ellipses_where_known():
    axes = Figure().subplots()
    spread = np.array([np.diag([1e-4, 4e-4]), np.full((2, 2), np.nan)])
    parameter_plane(axes, np.array([3.0, 4.0]), np.array([1.2e-4, 1e-4]), spread, ["a", "b"])
    labels = [line.get_label() for line in axes.lines]
    assert [label for label in labels if not label.startswith("_")] == ["a", "b"]
    assert axes.lines[0].get_ydata() == pytest.approx([0.12], rel=1e-12)  # mm
    assert len(axes.lines) == 3  # one ellipse


def test_the_ellipse_has_the_width_of_its_covariance():
    x, y = ellipse(3.0, 0.1, np.diag([1e-4, 4e-4]))
    assert np.log(x.max() / 3) == pytest.approx(np.sqrt(CHI2_95) * 0.01, rel=1e-6)  # a 72-gon touches its circle
    assert np.log(y.max() / 0.1) == pytest.approx(np.sqrt(CHI2_95) * 0.02, rel=1e-6)  # likewise


def test_intervals_over_temperature():
    axes = Figure().subplots()
    level = np.array([-12.0, np.nan])
    against_temperature(axes, level, np.array([3.0, 4.0]), np.array([[2.5, 3.2], [3, 5]]), ["a", "a"], "MPa")
    [bar] = axes.collections[0].get_segments()
    assert bar[:, 1] == pytest.approx([2.5, 3.2], rel=1e-12)  # a difference
    assert axes.get_ylim()[0] == 0
