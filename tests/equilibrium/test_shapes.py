"""Other shapes of softening and elastic unloading, in one bond and in a condensed specimen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.units import MM
from pipeline.equilibrium import active
from pipeline.equilibrium.solve import solve
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.softening import Shape, Softening, Unloading

from .specimens import chain, fracture_test


@pytest.mark.parametrize("shape", [Shape.EXPONENTIAL, Shape.BILINEAR_TAIL])
@pytest.mark.parametrize("unloading", list(Unloading))
def test_one_bond_follows_its_shape(shape: Shape, unloading: Unloading) -> None:
    """In series with a stiff spring the machine is always ahead of the bond."""
    line = LinearSoftening(np.array([4e8]), np.array([80.0]), np.array([1e-5]))
    problem = chain(1e9, line, 2e-5)
    law = problem.law
    shaped = CentralSoftening(law.k_n, law.f_max, law.delta_max, Softening(shape), unloading)
    solution = solve(replace(problem, law=shaped))
    bond = CentralSoftening(line.k_n, line.f_max, line.delta_max, Softening(shape), unloading)
    expected = bond.force(solution.curve.cmod, np.zeros(1))
    assert solution.curve.load == pytest.approx(expected, abs=4e-4 * 80)  # residual of 2e-4 f_max on either side
    assert solution.energy.error < 1e-3  # trapezoids along a curved branch


def test_a_condensed_specimen_of_another_law_is_the_whole_one(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = fracture_test(radius=1.5 * MM, scatter=0.4)
    law = problem.law
    shaped = CentralSoftening(law.k_n, law.f_max, law.delta_max, Softening(Shape.EXPONENTIAL), Unloading.ELASTIC)
    problem = replace(problem, law=shaped, cmod_max=0.15 * MM, stations=np.array([0.06, 0.14]) * MM)
    monkeypatch.setattr(active, "FEWEST", 0)
    part, whole = solve(problem), solve(problem, condensed=False)
    at = np.linspace(0.005, 0.145, 40) * MM
    # the tolerance, 2e-4 f_max, in the load of some tens of bonds
    assert part.curve.load_at(at) == pytest.approx(whole.curve.load_at(at), rel=2e-3)
    assert part.displacement == pytest.approx(whole.displacement, abs=2e-3 * np.abs(whole.displacement).max())
    assert part.energy.error < 1e-3  # trapezoids over the increments
