"""Condensation changes nothing but the time: elastic response to round-off, whole tests to the tolerance."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse

from pipeline.core.problem import Problem
from pipeline.core.units import MM
from pipeline.equilibrium import active
from pipeline.equilibrium.condensation import condense, schur_complement
from pipeline.equilibrium.model import whole_model
from pipeline.equilibrium.potential import factorise
from pipeline.equilibrium.solve import solve
from pipeline.equilibrium.step import Stepper

from .specimens import fracture_test


def laplacian(n: int) -> np.ndarray:
    """Stiffness of a chain of n springs without a support: singular."""
    return 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1) - np.diag(np.eye(n)[0] + np.eye(n)[-1])


@pytest.mark.parametrize("kept", [[0, 11], [3, 4, 8], [11]])
def test_schur_complement(kept: list[int]) -> None:
    """A chain of unit springs between its kept points: springs in series; loose at one kept point."""
    chain = laplacian(12)
    inner = np.setdiff1d(np.arange(12), kept)
    inside, across, outer = (
        sparse.csc_array(chain[np.ix_(a, b)]) for a, b in ((inner, inner), (inner, kept), (kept, kept))
    )
    found = schur_complement(inside, across, outer, factorise(inside))
    expected = np.zeros((len(kept), len(kept)))
    for i, (a, b) in enumerate(pairwise(kept)):
        expected[i : i + 2, i : i + 2] += np.array([[1, -1], [-1, 1]]) / (b - a)
    assert found == pytest.approx(expected, abs=1e-12)  # round-off of twelve pivots


@pytest.fixture(scope="module")
def beam() -> Problem:
    """Large enough to be condensed; scatter lets single bonds far from the crack soften."""
    problem = fracture_test(radius=1 * MM, scatter=0.6)
    return replace(problem, cmod_max=0.12 * MM, stations=np.array([0.05, 0.1]) * MM)


def test_elastic_response_is_that_of_the_whole(beam: Problem) -> None:
    whole = whole_model(beam)
    part = condense(whole, active.strip(beam))
    exact, found = Stepper(whole).elastic(), Stepper(part).elastic()
    assert part.kept.size < 0.3 * whole.gauge.size
    assert found.load == pytest.approx(exact.load, rel=1e-10)  # round-off of two factorisations
    assert part.complete(found.free, 1.0) == pytest.approx(exact.free, abs=1e-10)
    assert found.energy == pytest.approx(0.5 * exact.load, rel=1e-10)


def test_the_result_does_not_depend_on_condensation(beam: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also from a strip so narrow that bonds outside it soften and it must grow."""
    whole = solve(beam, condensed=False, tolerance=1e-5)
    growths = []
    monkeypatch.setattr(active, "FEWEST", 0)
    for share in (active.STRIP, 0.05):
        monkeypatch.setattr(active.strip, "__defaults__", (share,))
        monkeypatch.setattr("pipeline.equilibrium.solve.condense", lambda *a: growths.append(1) or condense(*a))
        part = solve(beam, tolerance=1e-5)
        at = np.linspace(0.005, 0.115, 40) * MM
        # residual 1e-5; increments may differ where one was repeated, 1e-4 of the curve
        assert part.curve.load_at(at) == pytest.approx(whole.curve.load_at(at), rel=5e-4)
        assert part.displacement == pytest.approx(whole.displacement, abs=5e-4 * np.abs(whole.displacement).max())
        assert part.energy.error == pytest.approx(whole.energy.error, abs=1e-5)
        assert np.array_equal(part.reached > beam.law.delta_peak, whole.reached > beam.law.delta_peak)
    assert len(growths) > 2
