"""The Burgers model and its relaxation modulus."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.materials.burgers import Burgers
from pipeline.materials.elastic import series
from pipeline.materials.interconversion import compliance_of, relaxation_of

compliances = st.floats(1e-12, 1e-6)
burgers = st.builds(Burgers, compliances, compliances, st.floats(1e8, 1e16), st.floats(1e-3, 1e6))
MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=3e12, tau2=80.0)


@given(burgers)
def test_compliance_begins_at_the_spring_and_ends_in_steady_flow(model):
    assert model.creep_compliance(0.0) == pytest.approx(model.d1, rel=1e-15)  # no arithmetic at t = 0
    late = 50 * model.tau2 * np.array([1.0, 2.0])
    rise = np.diff(late)[0] / model.eta1
    # round-off of the difference of two compliances
    assert np.diff(model.creep_compliance(late))[0] == pytest.approx(rise, abs=4e-16 * model.creep_compliance(late[1]))


@given(burgers)
def test_relaxation_is_two_decaying_exponentials_of_positive_weight(model):
    found = model.relaxation()
    assert found.infinity == 0
    assert found.time.shape == (2,)
    assert found.time[0] <= model.tau2 <= found.time[1]  # equal where a weight is lost in round-off
    assert (found.modulus > 0).all()
    assert found.instantaneous == pytest.approx(1 / model.d1, rel=1e-12)  # a dozen roundings, no cancellation
    assert found.viscosity == pytest.approx(model.eta1, rel=1e-12)  # as above


@given(burgers)
def test_modulus_and_compliance_are_each_others_inverse(model):
    s = np.logspace(-8, 6, 29) * (1 + 0.3j)
    product = s**2 * model.relaxation().laplace(s) * model.chain.laplace(s)
    assert product == pytest.approx(1, abs=1e-12)  # a dozen roundings, no cancellation


@given(burgers)
def test_closed_form_is_the_general_interconversion(model):
    general, own = relaxation_of(model.chain), model.relaxation()
    time = np.logspace(-4, 8, 61)
    scale = 1e-12 / model.d1  # a dozen roundings of moduli up to E(0)
    assert general.relaxation_modulus(time) == pytest.approx(own.relaxation_modulus(time), rel=1e-9, abs=scale)
    back = compliance_of(own)
    assert back.creep_compliance(time) == pytest.approx(model.creep_compliance(time), rel=1e-11)  # likewise


def test_convolution_of_both_is_time():
    # ∫ E(s) D(t − s) ds = t, by Gauss–Legendre on pieces of a tenth of the shorter time
    time = 700.0
    node, weight = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(0, time, 201)
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    at = (middle[:, None] + half[:, None] * node).ravel()
    weights = (half[:, None] * weight).ravel()
    found = np.sum(weights * MASTIC.relaxation_modulus(at) * MASTIC.creep_compliance(time - at))
    assert found == pytest.approx(time, rel=1e-12)  # 24th order on pieces of 3.5 s: below round-off


@given(burgers, st.floats(1e6, 1e12))
def test_interface_has_the_mean_of_the_compliances(model, modulus):
    mean = model.averaged_with_elastic(modulus)
    time = np.logspace(-3, 6, 37)
    expected = (model.creep_compliance(time) + 1 / modulus) / 2
    assert mean.creep_compliance(time) == pytest.approx(expected, rel=1e-14)  # rounding of four terms
    at_once = series(1 / model.d1, modulus)
    assert mean.relaxation().instantaneous == pytest.approx(at_once, rel=1e-12)  # the elastic interface


def test_interface_with_a_rigid_stone_is_half_as_compliant():
    mean = MASTIC.averaged_with_elastic(1e30)
    time = np.logspace(-1, 4, 11)
    assert mean.relaxation_modulus(time) == pytest.approx(2 * MASTIC.relaxation_modulus(time), rel=1e-12)  # 1/E ≈ 0


def test_a_shift_moves_times_only():
    warm = MASTIC.shifted(0.1)
    assert warm.creep_compliance(10.0) == pytest.approx(MASTIC.creep_compliance(100.0), rel=1e-14)  # rounding
    assert warm.relaxation_modulus(10.0) == pytest.approx(MASTIC.relaxation_modulus(100.0), rel=1e-12)  # rounding


def test_a_share_of_the_growth_on_another_modulus():
    other, time = MASTIC.like(25e9, 0.3), np.logspace(-1, 4, 11)
    growth = MASTIC.creep_compliance(time) / MASTIC.d1 - 1
    assert other.creep_compliance(time) == pytest.approx((1 + 0.3 * growth) / 25e9, rel=1e-12)  # rounding


@pytest.mark.parametrize("name", ["d1", "d2", "eta1", "tau2"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_refuses_what_is_no_constant(name, value):
    with pytest.raises(InputError, match=f"{name} = .* must be positive and finite"):
        Burgers(**{"d1": 1e-10, "d2": 1e-10, "eta1": 1e12, "tau2": 1.0} | {name: value})


def test_refuses_a_stone_without_stiffness():
    with pytest.raises(InputError, match="of the aggregate"):
        MASTIC.averaged_with_elastic(0.0)
