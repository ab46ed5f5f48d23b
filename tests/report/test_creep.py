"""Creep figures show the numbers they were given."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from pipeline.report.creep import creep_compliance, master_curve, relaxation_modulus, shift_factors

TIME = np.array([1.0, 10, 100])
D = np.array([1e-10, 2e-10, 4e-10])


def test_compliance_in_per_gpa_with_band_and_window():
    axes = Figure().subplots()
    creep_compliance(axes, TIME, D, TIME, {"Burgers": 1.1 * D}, (0.9 * D, 1.3 * D), (1.0, 50.0))
    lines = {line.get_label(): line for line in axes.lines}
    assert lines["measured"].get_ydata() == pytest.approx([0.1, 0.2, 0.4], rel=1e-12)  # a product
    assert lines["Burgers"].get_ydata() == pytest.approx([0.11, 0.22, 0.44], rel=1e-12)  # likewise
    corners = axes.collections[0].get_paths()[0].vertices
    assert corners[:, 1].min() == pytest.approx(0.09, rel=1e-12)  # likewise
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert [line.get_xdata()[0] for line in axes.lines if line.get_label().startswith("_")] == [1.0, 50.0]


def test_moduli_in_gpa_from_zero():
    axes = Figure().subplots()
    relaxation_modulus(axes, TIME, {"Burgers": 1 / D, "series": 2 / D})
    assert axes.lines[1].get_ydata() == pytest.approx([20, 10, 5], rel=1e-12)  # a quotient
    assert axes.get_ylim()[0] == 0


def test_each_temperature_has_a_line_in_celsius():
    axes = Figure().subplots()
    master_curve(axes, np.tile(TIME, 2), np.tile(D, 2), np.repeat([261.15, 273.15], 3))
    assert [line.get_label() for line in axes.lines] == ["-12 °C", "0 °C"]


def test_shifts_with_their_intervals():
    axes = Figure().subplots()
    level, shift = np.array([261.15, 273.15]), np.array([0.0, -1.0])
    shift_factors(axes, level, shift, np.column_stack([shift - 0.1, shift + 0.2]), level, {"WLF": shift})
    bars = axes.collections[0].get_segments()
    assert bars[1][:, 1] == pytest.approx([-1.1, -0.8], rel=1e-12)  # a sum
    assert axes.lines[0].get_xdata() == pytest.approx([-12, 0], abs=1e-9)  # a difference of numbers near 270
