"""Φ: eq. (5) by hand, rigid motion, one mask for all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.inverse.design import Design
from pipeline.inverse.objective import Objective, Rigid, compare, differences, left_out
from pipeline.inverse.observations import Measured, Simulated

from .hinge import CENTRE, LOAD_NOISE, NOISE, POINTS, STATIONS, measured, simulated

GRID = Design(CENTRE)
SIMULATED = simulated(GRID)


def noisy() -> Measured:
    return measured((68.0, 1.2e-4), np.random.default_rng(0))


def phi(data: Measured, simulation: Simulated = SIMULATED, objective=Objective.FIELDS, rigid=Rigid.KEEP) -> np.ndarray:
    return differences(compare(data, simulation, objective, rigid), simulation)[0]


def moved(data: Measured) -> Measured:
    """The camera slips and turns a little, differently at every station."""
    rng = np.random.default_rng(1)
    turned = np.column_stack([-POINTS[:, 1], POINTS[:, 0]])
    slip = 1e-3 * rng.standard_normal((10, 1, 2)) + 5e-3 * rng.standard_normal((10, 1, 1)) * turned
    return replace(data, field=replace(data.field, displacement=data.field.displacement + slip))


def test_equation_five_by_hand():
    data = noisy()
    by_hand = 0.0
    for j in range(10):
        for i in range(16):
            by_hand += np.linalg.norm(data.field.displacement[j, i] - SIMULATED.displacement[2, 3, j, i]) ** 2
    assert phi(data)[2, 3] == pytest.approx(by_hand, rel=1e-13)  # the same 320 squares


def test_load_objective_by_hand():
    data = noisy()
    by_hand = np.sum(((data.load - SIMULATED.load[4, 0]) / LOAD_NOISE) ** 2)
    assert phi(data, objective=Objective.LOAD)[4, 0] == pytest.approx(by_hand, rel=1e-13)  # the same ten squares


def test_both_is_the_sum_of_the_whitened_parts():
    data = noisy()
    parts = phi(data) / NOISE**2 + phi(data, objective=Objective.LOAD)
    np.testing.assert_allclose(phi(data, objective=Objective.BOTH), parts, rtol=1e-12)  # round-off


def test_noise_alone_leaves_its_own_sum_of_squares():
    truth = GRID.nodes()[12]
    found = [
        phi(measured(truth, np.random.default_rng(s)), objective=Objective.BOTH, rigid=Rigid.FIT)[2, 2]
        for s in range(40)
    ]
    expected = 320 - 3 * 10 + 10  # rigid motion takes three numbers a station
    assert np.mean(found) == pytest.approx(expected, abs=3 * np.sqrt(2 * expected / 40))  # 3 standard errors


def test_rigid_motion_is_taken_out_or_kept():
    data = noisy()
    np.testing.assert_allclose(phi(moved(data), rigid=Rigid.FIT), phi(data, rigid=Rigid.FIT), rtol=1e-8)
    # 1e-3 m of motion leaves round-off of 1e-19 m in residuals of 1e-6 m; squares of 320 of them
    assert phi(moved(data)).min() > 100 * phi(data).max()


def test_what_one_simulation_lacks_is_left_out_of_all():
    data, shortened = noisy(), SIMULATED.displacement.copy()
    shortened[0, 4, 8:] = np.nan
    shortened[3, 3, :, 5] = np.nan
    expected = replace(data, field=replace(data.field, valid=np.ones((10, 16), bool)))
    expected.field.valid[8:], expected.field.valid[:, 5] = False, False
    np.testing.assert_array_equal(phi(data, Simulated(shortened)), phi(expected))
    comparison = compare(data, Simulated(shortened), Objective.FIELDS, Rigid.KEEP)
    assert left_out(comparison) == (
        "40 of 160 displacement vectors are missing in the measurement or in a simulation, or lie on another side of "
        "the crack there, and are left out of all (2 of 10 stations wholly).",
    )
    assert left_out(compare(data, SIMULATED, Objective.FIELDS, Rigid.KEEP)) == ()


def test_missing_loads_are_left_out_and_counted():
    data = noisy()
    data.load[7:] = np.nan
    comparison = compare(data, SIMULATED, Objective.BOTH, Rigid.FIT)
    assert comparison.size == 320 + 7
    assert "3 of 10 loads" in left_out(comparison)[0]
    assert np.isfinite(differences(comparison, SIMULATED)[0]).all()


def test_a_station_with_two_points_cannot_be_fitted_rigidly():
    data = noisy()
    data.field.valid[4, 2:] = False
    assert not compare(data, SIMULATED, Objective.FIELDS, Rigid.FIT).use_field[4].any()
    assert compare(data, SIMULATED, Objective.FIELDS, Rigid.KEEP).use_field[4].sum() == 2


@pytest.mark.parametrize("rigid", Rigid)
def test_leverage_is_the_noise_that_leaves_with_the_rigid_motion(rigid):
    data = noisy()
    data.field.valid[2, 3:9] = False
    comparison = compare(data, SIMULATED, Objective.BOTH, rigid)
    unit = np.eye(320).reshape(320, 10, 16, 2)
    used = np.repeat(comparison.use_field.ravel(), 2)
    left = comparison.features(unit[used] * comparison.field_scale, np.zeros((int(used.sum()), 10)))
    diagonal = np.diagonal(left[:, : comparison.field_size])
    np.testing.assert_allclose(comparison.leverage[: comparison.field_size], 1 - diagonal, atol=1e-12)  # round-off
    assert np.all(comparison.leverage[comparison.field_size :] == 0)


@pytest.mark.parametrize(
    ("data", "simulation", "objective", "says"),
    [
        (replace(noisy(), field=None), SIMULATED, Objective.FIELDS, "use objective = load"),
        (noisy(), replace(SIMULATED, load=None), Objective.BOTH, "use objective = fields"),
        (
            noisy(),
            Simulated(np.full_like(SIMULATED.displacement, np.nan)),
            Objective.FIELDS,
            "only 0 displacement vectors",
        ),
        (noisy(), Simulated(SIMULATED.displacement[:, :, :, :4]), Objective.FIELDS, "shape"),
        (noisy(), Simulated(load=SIMULATED.load[..., :4]), Objective.LOAD, "shape"),
    ],
)
def test_refusals(data, simulation, objective, says):
    with pytest.raises(InputError, match=says):
        compare(data, simulation, objective, Rigid.FIT)


def test_measurements_must_be_at_the_stations_and_weighed():
    with pytest.raises(InputError, match="bring it to the stations"):
        replace(noisy(), cmod=STATIONS[:5])
    with pytest.raises(InputError, match="load_std_n"):
        replace(noisy(), load_std=np.zeros(10))


def test_fields_without_noise_cannot_be_weighed_against_loads():
    exact = measured((75.0, 1.1e-4), None, noise=0.0)
    with pytest.raises(InputError, match="noise"):
        compare(exact, simulated(Design(CENTRE)), Objective.BOTH, Rigid.FIT)
