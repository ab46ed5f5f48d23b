"""Load–CMOD and energy figures show the numbers they were given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import EnergyBalance
from pipeline.report.curves import energy_balance, load_cmod
from pipeline.report.style import png

CMOD = np.linspace(0, 0.5e-3, 501)
CURVE = LoadCurve(CMOD, CMOD, 2e3 * np.exp(-(((CMOD - 1e-4) / 1e-4) ** 2)), CMOD, np.full(501, 50.0))


def test_curves_in_mm_and_kn_with_peaks_and_stations():
    axes = Figure().subplots()
    load_cmod(axes, CURVE, {"simulated": replace(CURVE, load=1.1 * CURVE.load)}, np.array([1e-4, 3e-4]))
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_allclose(lines["measured"].get_xdata(), CMOD * 1e3)
    np.testing.assert_allclose(lines["simulated"].get_ydata(), 1.1e-3 * CURVE.load)
    np.testing.assert_allclose(lines["stations"].get_ydata(), 2 * np.exp([0.0, -4.0]), rtol=1e-3)  # between two rows
    peaks = [line for line in axes.lines if line.get_marker() == "v"]
    assert [p.get_ydata()[0] for p in peaks] == pytest.approx([2.0, 2.2], rel=1e-3)  # the parabola's own error
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("CMOD (mm)", "load $P$ (kN)")
    assert axes.get_ylim()[0] == 0


def test_the_band_is_as_wide_as_it_says():
    axes = Figure().subplots()
    load_cmod(axes, CURVE, {}, band=2)
    corners = axes.collections[0].get_paths()[0].vertices
    at_end = corners[np.isclose(corners[:, 0], 0.5)]
    assert np.ptp(at_end[:, 1]) == pytest.approx(0.2)  # ± 2 × 50 N in kN
    assert "± 2 standard deviations" in [t.get_text() for t in axes.get_legend().get_texts()]


def test_stations_outside_the_record_are_not_drawn():
    axes = Figure().subplots()
    load_cmod(axes, CURVE, {}, np.array([1e-4, 9e-4]))
    assert np.isnan(next(line for line in axes.lines if line.get_label() == "stations").get_ydata()[1])


def test_a_curve_below_zero_is_not_cut():
    axes = Figure().subplots()
    load_cmod(axes, None, {"pulled back": replace(CURVE, load=CURVE.load - 100)})
    assert axes.get_ylim()[0] < -0.09


def test_energies_are_stacked_to_their_sum():
    axes = Figure().subplots()
    energy_balance(axes, EnergyBalance(1.0, 0.2, 0.7, 1e-6, 0.08))
    widths = {bar.get_label(): bar[0].get_width() for bar in axes.containers}
    assert widths["dissipated by bonds"] == 0.7
    assert "kinetic" not in widths  # too small to be seen
    assert sum(bar[0].get_width() for bar in axes.containers[1:]) == pytest.approx(0.98)
    assert any("(98.0%)" in text.get_text() for text in axes.texts)


def test_both_can_be_rendered():
    assert png(
        lambda a: load_cmod(a, CURVE, {"s": CURVE}, CMOD[100:500:100]),
        lambda a: energy_balance(a, EnergyBalance(1.0, 0.5, 0.5)),
        columns=2,
    )
