"""Positive series from data."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.materials import series_fit
from pipeline.materials.burgers import Burgers
from pipeline.materials.interconversion import relaxation_of
from pipeline.materials.prony import PronySeries
from pipeline.materials.series_fit import fit_creep, fit_dynamic, fit_relaxation, spaced_times

TIME = np.logspace(0, 3, 31)
MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0)


def literature(folder, name):
    """Time and modulus of each term of a published set, signs and all."""
    return np.loadtxt(folder / "asphalt_viscomodule" / f"{name}.csv", delimiter=",").T


def test_times_are_evenly_spread_over_decades():
    assert spaced_times(0.1, 1000.0, 1.0) == pytest.approx([0.1, 1, 10, 100, 1000], rel=1e-14)  # powers
    assert spaced_times(2.0, 2.0).tolist() == [2.0]
    with pytest.raises(InputError, match="must be positive and increase"):
        spaced_times(10.0, 1.0)


def test_a_series_is_found_again_with_its_own_times():
    chain = fit_creep(TIME, MASTIC.creep_compliance(TIME), np.array([0.8, 8.0, 80.0, 800.0]))
    assert chain.instantaneous == pytest.approx(MASTIC.d1, rel=1e-9)  # condition of the system, 1e5
    assert chain.fluidity == pytest.approx(1 / MASTIC.eta1, rel=1e-9)  # likewise
    assert chain.creep_compliance(TIME) == pytest.approx(MASTIC.creep_compliance(TIME), rel=1e-12)  # exact fit


def test_a_term_a_decade_follows_other_times_to_a_percent():
    chain = fit_creep(TIME, MASTIC.creep_compliance(TIME), spaced_times(1.0, 1000.0, 1.0))
    difference = chain.creep_compliance(TIME) / MASTIC.creep_compliance(TIME) - 1
    assert np.abs(difference).max() < 0.01  # measured: 0.6 %
    modulus = relaxation_of(chain).relaxation_modulus(TIME) - MASTIC.relaxation_modulus(TIME)
    assert np.abs(modulus * MASTIC.d1).max() < 0.01  # of E(0); relative to E(1000 s), a twelfth of it, ten times more


@settings(max_examples=60)
@given(st.lists(st.floats(0.3, 3.0), min_size=31, max_size=31), st.booleans())
def test_whatever_the_data_the_material_makes_no_energy(scatter, flows):
    chain = fit_creep(TIME, MASTIC.creep_compliance(TIME) * np.array(scatter), spaced_times(1, 1000), flows=flows)
    assert (np.diff(chain.creep_compliance(TIME)) >= 0).all()
    if chain.fluidity or chain.time.size:
        series = relaxation_of(chain)
        assert (np.diff(series.relaxation_modulus(TIME)) <= 0).all()
        assert (series.complex_modulus(1 / TIME).imag > 0).all()


def test_the_slightly_negative_term_of_the_literature(shared_data):
    time, modulus = literature(shared_data, "Kim2009")
    assert modulus.min() == -0.3
    with pytest.raises(InputError, match="must be finite and positive"):
        PronySeries(0.0, modulus, time)
    at = np.logspace(-7, 3, 101)  # beyond, the published sum itself is negative
    wanted = np.exp(-at[:, None] / time) @ modulus
    assert (wanted > 0).all()
    series = fit_relaxation(at, wanted, time)
    assert (series.modulus > 0).all()
    assert np.abs(series.relaxation_modulus(at) / wanted - 1).max() < 0.01  # 0.3 of the 37.1 MPa left at 1e3 s


@pytest.mark.parametrize("name", ["Park1999", "Gibson2003", "Souza2005"])
def test_positive_sets_of_the_literature_are_found_again(shared_data, name):
    time, modulus = literature(shared_data, name)
    truth = PronySeries(0.01 * modulus.min(), modulus, time)
    at = np.geomspace(truth.time[0] / 30, 30 * truth.time[-1], 200)
    series = fit_relaxation(at, truth.relaxation_modulus(at), truth.time)
    assert series.modulus == pytest.approx(truth.modulus, rel=1e-6)  # condition of the system
    frequency = 1 / at
    again = fit_dynamic(frequency, truth.complex_modulus(frequency), truth.time)
    assert again.modulus == pytest.approx(truth.modulus, rel=1e-6)  # likewise


def test_where_one_solver_goes_in_circles_the_other_finds_the_same(monkeypatch):
    design = np.column_stack([np.ones_like(TIME), TIME, np.exp(-TIME / 30)])
    wanted = 1 + 0.5 * np.exp(-TIME / 30) - 1e-4 * TIME
    usual = series_fit.not_negative(design, wanted)

    def circles(*args: object, **options: object) -> None:
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr(series_fit, "nnls", circles)
    assert series_fit.not_negative(design, wanted) == pytest.approx(usual, rel=1e-6, abs=1e-9)  # stop of the solver
    assert usual[1] == 0  # the bound holds


def test_refuses_what_cannot_be_fitted():
    with pytest.raises(InputError, match=r"compliance = 0 1/Pa must be positive"):
        fit_creep(TIME, 0 * TIME, spaced_times(1, 1000))
    with pytest.raises(InputError, match="one each is needed"):
        fit_creep(TIME, np.ones(3), spaced_times(1, 1000))
    with pytest.raises(InputError, match="show no relaxation"):
        fit_relaxation(TIME, 1e9 * np.ones_like(TIME), np.array([1e-6]))
