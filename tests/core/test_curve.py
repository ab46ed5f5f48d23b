"""Load–CMOD curves: what can be redone on paper."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError


def triangle() -> LoadCurve:
    """Up to 2 kN at 0.1 mm, down to nothing at 0.5 mm, at 1 mm/s; the load line moves twice as far."""
    cmod = np.linspace(0, 0.5e-3, 501)
    load = np.interp(cmod, [0, 0.1e-3, 0.5e-3], [0, 2e3, 0])
    return LoadCurve(cmod / 1e-3, cmod, load, 2 * cmod)


def test_areas_of_a_triangle():
    assert triangle().cmod_area() == pytest.approx(0.5, rel=1e-12)  # J; half of 0.5 mm × 2 kN, exact for straight lines
    assert triangle().work() == pytest.approx(1.0, rel=1e-12)  # twice the travel
    assert np.isnan(LoadCurve(np.arange(3.0), np.arange(3.0), np.arange(3.0)).work())


@given(
    position=st.floats(0.03e-3, 0.2e-3), top=st.floats(10, 1e5), sharpness=st.floats(1e6, 1e8), offset=st.floats(0, 1)
)
def test_peak_of_a_parabola_between_the_samples(position, top, sharpness, offset):
    cmod = np.arange(0, 0.25e-3, 1e-6) + offset * 1e-6
    found, load = LoadCurve(cmod, cmod, top * (1 - sharpness * (cmod - position) ** 2)).peak()
    assert found == pytest.approx(position, abs=1e-9)  # m; a thousandth of the sampling
    assert load == pytest.approx(top, rel=1e-8)  # round-off of the fit where the parabola is flat


def test_peak_of_a_noisy_flat_top_is_better_than_the_largest_sample():
    cmod = np.linspace(0, 0.2e-3, 401)
    rng = np.random.default_rng(3)
    exact = 1000 * (1 - ((cmod - 0.08e-3) / 0.2e-3) ** 2)
    noisy = [LoadCurve(cmod, cmod, exact + 3 * rng.standard_normal(cmod.size)) for _ in range(50)]
    ours = np.std([c.peak()[0] for c in noisy])
    largest = np.std([c.cmod[np.argmax(c.load)] for c in noisy])
    assert ours < 0.5 * largest  # about 100 samples share in the parabola; measured 0.25


@pytest.mark.parametrize("load", [[0, 1, 2, 3], [3, 2, 1, 0], [0, 5, 0, 0]])
def test_a_peak_without_a_parabola_is_the_largest_sample_or_lies_among_its_neighbours(load):
    cmod, force = LoadCurve(np.arange(4.0), np.arange(4.0), np.array(load, float)).peak()
    top = int(np.argmax(load))
    assert abs(cmod - top) <= 1
    assert force == pytest.approx(max(load), rel=0.2)


def test_an_end_off_by_round_off_is_the_end():
    curve = LoadCurve(np.arange(3.0), np.array([0, 1e-4, 2e-4 * (1 - 1e-9)]), np.array([0, 5.0, 8.0]))
    np.testing.assert_allclose(curve.load_at(np.array([2e-4])), [8.0], rtol=1e-14)
    assert np.isnan(curve.load_at(np.array([2.0001e-4]))).all()


def test_a_saw_tooth_uses_the_first_passage():
    curve = LoadCurve(np.arange(5.0), np.array([0, 2, 1, 2, 3.0]), np.array([0, 20, 5, 99, 30.0]))
    np.testing.assert_allclose(curve.load_at(np.array([1.0, 2.0, 2.5])), [10, 20, 25], rtol=1e-14)  # by hand
    np.testing.assert_allclose(curve.time_at(np.array([2.0, 2.5])), [1, 2.5], rtol=1e-14)  # by hand


def test_outside_the_record_there_is_nothing():
    curve = triangle()
    assert np.isnan(curve.load_at(np.array([-1e-6, 0.6e-3]))).all()
    assert np.isnan(curve.time_at(np.array([0.6e-3]))).all()
    assert np.isnan(curve.cmod_at(np.array([-0.1, 0.6]))).all()


def test_time_and_cmod_are_inverse():
    at = np.array([0.0123e-3, 0.3e-3])
    np.testing.assert_allclose(triangle().cmod_at(triangle().time_at(at)), at, rtol=1e-12)  # both piecewise linear


def test_until_keeps_one_row_beyond_and_every_column():
    cut = triangle().until(0.1005e-3)
    assert cut.cmod[-1] == pytest.approx(0.101e-3)
    assert cut.load_line is not None
    assert len(cut.time) == len(cut.load) == len(cut.load_line) == 102
    assert triangle().until(1.0).cmod.size == 501
    assert triangle().until(-1.0).cmod.size == 3  # the shortest curve there is


@pytest.mark.parametrize("columns", [(3, 3, 4), (2, 2, 2)])
def test_refusals(columns):
    with pytest.raises(InputError, match="curve"):
        LoadCurve(*(np.arange(float(n)) for n in columns))
