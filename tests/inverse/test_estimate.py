"""Twin experiments on a smooth nonlinear test, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.inverse.design import Design
from pipeline.inverse.estimate import Settings, estimate, refusal
from pipeline.inverse.newton import Minimum
from pipeline.inverse.objective import Objective, Rigid
from pipeline.inverse.observations import Simulated

from .hinge import CENTRE, field, load, measured, simulated

GRID = Design(CENTRE)
SIMULATED = simulated(GRID)
INSIDE = Minimum(np.array(CENTRE), 1.0, np.eye(2), True, True, 5)


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("rigid", Rigid)
def test_without_noise_the_truth_comes_back(objective, rigid):
    truth = (75.3, 1.07e-4)
    found = estimate(GRID, SIMULATED, measured(truth, None), Settings(objective, 0.0, rigid))
    # the grid's multinomial of degree 8 in all; Φ of this model has a relative interpolation error near 1e-3
    assert found.f_max == pytest.approx(truth[0], rel=5e-3)
    assert found.delta_max == pytest.approx(truth[1], rel=5e-3)
    assert found.bond_energy == pytest.approx(truth[0] * truth[1] / 2, rel=5e-3)
    assert found.interior


@pytest.mark.parametrize("objective", Objective)
def test_twins_with_noise_lie_in_their_intervals(objective):
    rng, inside, errors = np.random.default_rng(3), [], []
    for _ in range(25):
        truth = CENTRE * rng.uniform(0.88, 1.12, 2)
        found = estimate(GRID, SIMULATED, measured(tuple(truth), rng), Settings(objective, 0.0))
        if not found.interior:
            continue
        assert found.accepted, found.status
        inside += [found.uncertainty.f_max[0] <= truth[0] <= found.uncertainty.f_max[1]]
        inside += [found.uncertainty.delta_max[0] <= truth[1] <= found.uncertainty.delta_max[1]]
        errors.append(found.minimum.position / truth - 1)
    assert len(errors) >= 22
    assert np.mean(inside) >= 0.86  # 95 % of 50, three standard errors
    limit = (0.08, 0.05) if objective is Objective.FIELDS else (0.01, 0.01)
    assert np.all(np.abs(errors).max(axis=0) < limit)  # 2.5 times the stated standard deviations, 3.4 and 1.8 %, 0.3 %


def test_noise_free_data_at_a_node_are_met_there():
    found = estimate(GRID, SIMULATED, measured(GRID.nodes()[12], None), Settings(Objective.BOTH, 0.0))
    assert found.objective[2, 2] == 0
    np.testing.assert_allclose(found.minimum.position, GRID.nodes()[12], rtol=3e-3)  # P need not be flat at its node


def test_the_fit_is_the_simulation_at_the_optimum():
    truth = (75.3, 1.07e-4)
    found = estimate(GRID, SIMULATED, measured(truth, None), Settings(Objective.BOTH, 0.0))
    np.testing.assert_allclose(found.displacement, field(*truth), atol=0.1e-6)  # m; a quarter of the noise
    np.testing.assert_allclose(found.load, load(*truth), rtol=5e-3)  # interpolation between nodes 10 % apart


def test_an_optimum_outside_has_no_interval_and_moving_the_grid_finds_it():
    data = measured((96.0, 0.84e-4), np.random.default_rng(4))
    settings = Settings(Objective.BOTH, 0.0)
    found = estimate(GRID, SIMULATED, data, settings)
    assert not found.interior
    assert found.uncertainty is None
    assert "edge" in found.warnings[0]
    grid = GRID
    for _ in range(3):
        grid = grid.recentred(found.f_max, found.delta_max)
        found = estimate(grid, simulated(grid), data, settings)
        if found.interior:
            break
    assert found.accepted
    assert found.f_max == pytest.approx(96.0, rel=0.01)
    assert found.delta_max == pytest.approx(0.84e-4, rel=0.015)


def test_missing_points_are_left_out_of_all_nodes_and_told():
    holes = SIMULATED.displacement.copy()
    holes[1, 2, :, 3] = np.nan
    data = measured((75.3, 1.07e-4), None)
    found = estimate(GRID, replace(SIMULATED, displacement=holes), data, Settings(Objective.FIELDS, 0.0))
    assert found.f_max == pytest.approx(75.3, rel=5e-3)
    assert "10 of 160" in found.left_out[0]
    assert found.left_out[0] in found.warnings
    assert np.isnan(found.displacement[:, 3]).all()
    assert np.isfinite(np.delete(found.displacement, 3, axis=1)).all()


def test_loads_alone_need_no_fields():
    data = replace(measured((75.3, 1.07e-4), None), field=None)
    found = estimate(GRID, Simulated(load=SIMULATED.load), data, Settings(Objective.LOAD, 0.05))
    assert found.f_max == pytest.approx(75.3, rel=5e-3)
    assert found.displacement is None


def test_a_modulus_error_moves_the_strength_as_its_interval_says():
    """The scaling law on a twin: fields of a specimen 10 % stiffer than assumed."""
    truth, stiffer = (75.0, 1.1e-4), 1.10
    data = measured(
        (truth[0] / stiffer, truth[1]), np.random.default_rng(8)
    )  # what a stiffer specimen's field looks like
    found = estimate(GRID, SIMULATED, data, Settings(Objective.FIELDS, 0.05))
    low, high = found.uncertainty.f_max
    assert low <= truth[0] <= high  # two standard deviations of the modulus
    modulus = next(c for c in found.uncertainty.budget if c.name == "modulus")
    assert np.sqrt(modulus.covariance[0, 0]) == pytest.approx(0.05 * found.f_max, rel=1e-9)


def test_scattered_simulations_are_recognised():
    rng = np.random.default_rng(9)
    jumping = Simulated(
        SIMULATED.displacement
        + 10e-6
        * rng.standard_normal(SIMULATED.displacement.shape[:3])[..., None, None]
        * [1, 0]
        * np.sign(np.arange(16) - 7.5)[:, None]
    )
    found = estimate(GRID, jumping, measured((71.0, 1.14e-4), rng), Settings(Objective.FIELDS, 0.0))
    smooth = estimate(GRID, SIMULATED, measured((71.0, 1.14e-4), rng), Settings(Objective.FIELDS, 0.0))
    assert found.loo_error > 100 * smooth.loo_error
    assert found.refused or found.warnings


@pytest.mark.parametrize(
    ("minimum", "numbers", "says"),
    [
        (INSIDE, (2.0, 1.05, 0.1), ""),  # a valley between nodes, as deep as the data say
        (INSIDE, (1.05, 3.0, 0.1), ""),
        (INSIDE, (2.0, 1.5, 0.1), "below the smallest node"),
        (replace(INSIDE, value=-0.01), (2.0, 0.0, 5.0), "negative"),
        (replace(INSIDE, interior=False), (2.0, 1.0, 0.1), "edge"),
        (replace(INSIDE, converged=False), (2.0, 1.0, 0.1), "did not converge"),
        (replace(INSIDE, hessian=np.diag([1.0, -1.0])), (2.0, 1.0, 0.1), "not positive definite"),
    ],
)
def test_what_is_accepted(minimum, numbers, says):
    found = refusal(minimum, *numbers)
    assert says in found
    assert bool(found) == bool(says)


def test_a_failed_simulation_and_a_wrong_confidence_are_refused():
    dead = SIMULATED.load.copy()
    dead[0, 0] = np.nan
    with pytest.raises(InputError, match="in every simulation"):
        estimate(GRID, Simulated(load=dead), measured(CENTRE, None), Settings(Objective.LOAD, 0.0))
    with pytest.raises(InputError, match="confidence"):
        Settings(Objective.LOAD, 0.0, confidence=95)


def test_fields_said_to_be_exact_have_finite_intervals():
    truth = (75.3, 1.07e-4)
    data = measured(truth, np.random.default_rng(6))
    exact = replace(data, field=replace(data.field, std=np.zeros_like(data.field.std)))
    found = estimate(GRID, SIMULATED, exact, Settings(Objective.FIELDS, 0.0))
    assert found.accepted
    assert found.uncertainty.f_max[0] < truth[0] < found.uncertainty.f_max[1]  # the residual speaks instead
    assert np.isfinite(found.uncertainty.delta_max).all()
