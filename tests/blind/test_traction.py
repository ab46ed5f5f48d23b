"""The law of an edge against its closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.blind.traction import Branch, Edges

PENALTY, STRENGTH, LAST = 1e15, 4e6, 1e-4


def edges(q: int = 1, beta: float = 1.0, tail: float = 0.0) -> Edges:
    return Edges(np.full(q, PENALTY), np.full(q, STRENGTH), np.full(q, LAST), beta, Branch(tail))


@pytest.mark.parametrize("tail", [0.0, 0.3, 1.0])
def test_every_branch_has_the_area_one_half(tail):
    branch = Branch(tail)
    assert branch.area(np.array([branch.end]))[0] == pytest.approx(0.5, rel=1e-12)  # closed form, round-off
    assert branch.left(np.array([0.0, branch.end])).tolist() == [1.0, 0.0]


def test_tail_one_is_petersson():
    branch = Branch(1.0)  # w₁ = 0.8 G/f and w_c = 3.6 G/f, in units of the straight end 2 G/f
    assert (branch.knee, branch.end) == pytest.approx((0.4, 1.8), rel=1e-12)  # closed form


@pytest.mark.parametrize("tail", [0.0, 1.0])
def test_opening_costs_the_fracture_energy(tail):
    law = edges(tail=tail)
    way = np.linspace(0, 2 * LAST, 200_001)
    pull = [law.traction(np.array([[w, 0.0]]), np.zeros(1))[0, 0] for w in way[::200]]
    assert np.trapezoid(pull, way[::200]) == pytest.approx(STRENGTH * LAST / 2, rel=3e-3)  # 1001 points over a kink
    assert law.dissipated(np.array([2 * LAST]))[0] == pytest.approx(STRENGTH * LAST / 2, rel=1e-9)  # round-off


def test_sliding_is_beta_times_as_strong_for_the_same_energy():
    law = edges(beta=0.5)
    slide = np.linspace(0, 4 * LAST, 4001)
    pull = np.array([law.traction(np.array([[0.0, s]]), np.zeros(1))[0, 1] for s in slide])
    assert pull.max() == pytest.approx(0.5 * STRENGTH, rel=1e-3)  # peak between two of 4001 points
    assert np.trapezoid(pull, slide) == pytest.approx(STRENGTH * LAST / 2, rel=2e-3)  # the same


def test_unloading_goes_to_the_origin_and_contact_is_stiff():
    law, reached = edges(), np.array([0.4 * LAST])
    top = law.traction(np.array([[0.4 * LAST, 0.0]]), reached)[0, 0]
    assert law.traction(np.array([[0.2 * LAST, 0.0]]), reached)[0, 0] == pytest.approx(top / 2, rel=1e-12)  # secant
    assert law.traction(np.array([[-1e-9, 0.0]]), reached)[0, 0] == pytest.approx(-PENALTY * 1e-9, rel=1e-12)


@given(
    normal=st.floats(-1e-8, 1.5e-4), slide=st.floats(-1.5e-4, 1.5e-4), reached=st.floats(0, 1e-4),
    beta=st.floats(0.4, 1.6), tail=st.floats(0, 1),
)  # fmt: skip
def test_traction_is_the_gradient_of_the_energy(normal, slide, reached, beta, tail):
    law, place, seen = edges(beta=beta, tail=tail), np.array([[normal, slide]]), np.array([reached])
    now, step = law.effective(place)[0], 1e-13
    corners = [law.first[0], reached, law.first[0] + law.branch.knee * (LAST - law.first[0])]
    if abs(normal) < 1e-10 or min(abs(now - c) for c in corners) < 1e-9:
        return  # a kink between the two sides of the difference
    found = law.traction(place, seen)[0]
    for axis in (0, 1):
        aside = np.zeros((1, 2))
        aside[0, axis] = step = 1e-10
        rise = law.energy(place + aside, seen)[0] - law.energy(place - aside, seen)[0]
        # second-order error of the difference, and the round-off of energies up to 400 J/m²
        assert found[axis] == pytest.approx(rise / (2 * step), rel=1e-4, abs=3e3)


def test_tangent_is_the_derivative_of_the_traction():
    law, seen = edges(beta=0.8), np.array([0.1 * LAST])
    for place in ([0.3 * LAST, 0.1 * LAST], [0.02 * LAST, 0.01 * LAST], [-1e-9, 0.4 * LAST]):
        at, step = np.array([place]), 1e-10
        rows = [
            (law.traction(at + step * e, seen) - law.traction(at - step * e, seen))[0] / (2 * step) for e in np.eye(2)
        ]
        assert law.tangent(at, seen)[0] == pytest.approx(np.array(rows), rel=1e-4, abs=1e7)  # difference
