"""The objective's map: nodes, optimum, region of 95 %."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from pipeline.core.field import DisplacementField
from pipeline.inverse.design import Design
from pipeline.inverse.estimate import Estimate, Settings, estimate
from pipeline.inverse.objective import Objective
from pipeline.inverse.observations import Measured, Simulated
from pipeline.report.objective import objective_surface
from pipeline.report.style import png

GRID = Design((71.0, 1.14e-4))
POINTS = np.array([(x, y) for x in (-5e-3, 5e-3) for y in (15e-3, 17e-3, 19e-3)])


def found(objective: Objective, truth: tuple[float, float]) -> Estimate:
    """An estimate on fields and loads that are smooth in both parameters."""

    def field(f: float, d: float) -> np.ndarray:
        s = np.arange(1, 6)[:, None, None]
        return 1e-6 * s * ((f / 71) ** 2 * POINTS * 300 + (d / 1.14e-4) * POINTS[:, ::-1] * [[-200, 90]] * s)

    def load(f: float, d: float) -> np.ndarray:
        return f * np.exp(-np.arange(5) / 3 / (d / 1.14e-4))

    rng, cmod = np.random.default_rng(0), np.arange(1, 6) * 5e-5
    u = field(*truth) + 0.1e-6 * rng.standard_normal((5, 6, 2))
    data = DisplacementField(POINTS, u, np.ones((5, 6), bool), np.full((5, 6), 0.1e-6), cmod)
    measured = Measured(cmod, data, load(*truth) + 0.5 * rng.standard_normal(5), np.full(5, 0.5))
    nodes = GRID.nodes()
    simulated = Simulated.of(GRID, [field(*n) for n in nodes], [load(*n) for n in nodes])
    return estimate(GRID, simulated, measured, Settings(objective, 0.0))


@pytest.mark.parametrize("objective", Objective)
def test_nodes_optimum_and_energy_line_are_where_they_belong(objective):
    one = found(objective, (74.0, 1.1e-4))
    axes = Figure().subplots()
    objective_surface(axes, one, 41)
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    assert len(lines["simulations"]) == 25
    np.testing.assert_allclose(lines["optimum"], [[one.f_max, one.delta_max * 1e6]])
    energy = lines["same fracture energy"].prod(axis=1)
    np.testing.assert_allclose(energy, one.f_max * one.delta_max * 1e6, rtol=1e-12)
    assert axes.get_xlabel() == "$f_\\mathrm{max}$ (N)"
    assert "µm" in axes.get_ylabel()


def test_the_region_holds_95_percent_of_a_normal_pair():
    one = found(Objective.FIELDS, (74.0, 1.1e-4))
    axes = Figure().subplots()
    objective_surface(axes, one, 21)
    ellipse = next(patch for patch in axes.patches if isinstance(patch, Ellipse))
    draws = np.random.default_rng(1).multivariate_normal(one.minimum.position, one.uncertainty.covariance, 20_000)
    middle, angle = np.array(ellipse.center), np.radians(ellipse.angle)
    arm = (draws * [1, 1e6] - middle) @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    inside = np.sum((arm / [ellipse.width / 2, ellipse.height / 2]) ** 2, axis=1) <= 1
    assert inside.mean() == pytest.approx(0.95, abs=0.006)  # four standard errors of 20 000 draws


def test_an_optimum_on_the_edge_is_called_so_and_has_no_region():
    one = found(Objective.FIELDS, (95.0, 1.1e-4))
    assert not one.interior
    axes = Figure().subplots()
    objective_surface(axes, one, 21)
    assert "best on the edge" in [line.get_label() for line in axes.lines]
    assert not axes.patches


def test_a_surface_that_touches_zero_is_drawn():
    one = found(Objective.FIELDS, GRID.nodes()[12])
    flat = replace(one, valley=replace(one.surrogate, values=0 * one.surrogate.values))
    for each in (one, flat):
        assert png(lambda axes, each=each: objective_surface(axes, each, 21))
