"""Exact interconversion of series of any length."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.materials.interconversion import compliance_of, relaxation_of
from pipeline.materials.kelvin_chain import KelvinChain, elastic
from pipeline.materials.prony import PronySeries

S = np.logspace(-10, 9, 39)


@st.composite
def terms(draw, least=1):
    """Positive sizes and times over many decades, the times at least 1 % apart."""
    count = draw(st.integers(least, 12))
    size = draw(st.lists(st.floats(1e-6, 1.0), min_size=count, max_size=count))
    time = np.sort(10.0 ** np.array(draw(st.lists(st.floats(-6, 7), min_size=count, max_size=count))))
    assume((np.diff(time) > 0.01 * time[:-1]).all())
    return np.array(size), time


flows = st.one_of(st.just(0.0), st.floats(1e-6, 1.0))


@given(terms(), flows)
def test_there_and_back_again(term, infinity):
    series = PronySeries(infinity, *term)
    chain = compliance_of(series)
    back = relaxation_of(chain)
    assert chain.time.size == series.time.size - (infinity == 0)
    assert chain.compliance.size == 0 or (chain.compliance > 0).all()
    assert back.infinity == pytest.approx(infinity, rel=1e-10)  # sums of twelve terms
    assert back.modulus == pytest.approx(series.modulus, rel=1e-8)  # zeros 1 % apart lose two digits, twice
    assert back.time == pytest.approx(series.time, rel=1e-10)  # likewise


@given(terms(), flows)
def test_product_in_laplace_space_is_one(term, infinity):
    series = PronySeries(infinity, *term)
    product = S**2 * series.laplace(S) * compliance_of(series).laplace(S)
    assert product == pytest.approx(1, abs=1e-10)  # sums of twelve terms, zeros to round-off


@given(terms(least=0), st.floats(1e-3, 1.0), flows)
def test_a_chain_relaxes(term, instantaneous, fluidity):
    chain = KelvinChain(instantaneous, fluidity, *term)
    assume(fluidity or chain.time.size)
    series = relaxation_of(chain)
    assert series.time.size == chain.time.size + (fluidity > 0)
    assert S**2 * series.laplace(S) * chain.laplace(S) == pytest.approx(1, abs=1e-10)  # as above
    assert series.instantaneous == pytest.approx(1 / instantaneous, rel=1e-10)  # sum of the weights


def test_zener_solid_by_hand():
    # E = 1 + 3 e^(−t): D = 1 − ¾ e^(−t/4), from D̃ = (s + 1)/(s (4s + 1))
    chain = compliance_of(PronySeries(1.0, np.array([3.0]), np.array([1.0])))
    assert chain.instantaneous == 0.25
    assert chain.fluidity == 0
    assert chain.compliance == pytest.approx([0.75], rel=1e-15)  # rounding
    assert chain.time == pytest.approx([4.0], rel=1e-15)  # rounding


def test_maxwell_element_by_hand():
    chain = compliance_of(PronySeries(0.0, np.array([2.0]), np.array([5.0])))
    assert (chain.instantaneous, chain.fluidity, chain.time.size) == (0.5, 0.1, 0)
    series = relaxation_of(chain)
    assert (series.infinity, *series.modulus, *series.time) == pytest.approx((0, 2, 5), rel=1e-14)  # rounding


def test_terms_of_one_time_are_one_term():
    twice = PronySeries(0.5, np.array([1.0, 2.0]), np.array([3.0, 3.0]))
    once = PronySeries(0.5, np.array([3.0]), np.array([3.0]))
    assert compliance_of(twice).compliance == pytest.approx(compliance_of(once).compliance, rel=1e-14)  # rounding


@pytest.mark.parametrize("name", ["Park1999", "Gibson2003", "Souza2005"])
def test_sets_of_the_literature(shared_data, name):
    # eleven or twelve terms over eleven decades; each set as a liquid and with a modulus that stays
    time, modulus = np.loadtxt(shared_data / "asphalt_viscomodule" / f"{name}.csv", delimiter=",").T
    for infinity in (0.0, 1e-3 * modulus.max()):
        series = PronySeries(infinity, modulus, time)
        chain = compliance_of(series)
        back = relaxation_of(chain)
        assert back.modulus == pytest.approx(series.modulus, rel=1e-12)  # measured: 2e-15
        assert back.time == pytest.approx(series.time, rel=1e-12)  # measured: 6e-16
        # ∫ E(s) D(t − s) ds = t, Park and Kim 1999 eq. (7): in closed form for exponentials
        at = np.logspace(-9, 8, 35)
        assert convolution(series, chain, at) == pytest.approx(at, rel=1e-9)  # products over eleven decades


def convolution(series: PronySeries, chain: KelvinChain, at: np.ndarray) -> np.ndarray:
    """∫₀ᵗ E(s) D(t − s) ds by Gauss–Legendre in log s and in log (t − s)."""
    node, weight = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(-60, 0, 121)
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    u = np.exp((middle[:, None] + half[:, None] * node).ravel())
    w = (half[:, None] * weight).ravel() * u
    total = np.zeros_like(at)
    for k, t in enumerate(at):
        s = 0.5 * t * u
        near = series.relaxation_modulus(s) * chain.creep_compliance(t - s)
        far = series.relaxation_modulus(t - s) * chain.creep_compliance(s)
        total[k] = 0.5 * t * np.sum(w * (near + far))
    return total


def test_a_spring_alone_has_no_arms():
    with pytest.raises(InputError, match="only a spring"):
        relaxation_of(elastic(1e9))
