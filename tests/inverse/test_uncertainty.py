"""Intervals: coverage by Monte Carlo where every statistic is known, and the scaling law of the modulus."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.inverse.discrepancy import Discrepancy
from pipeline.inverse.newton import minimise
from pipeline.inverse.objective import Objective, Rigid
from pipeline.inverse.surrogate import LagrangeSurrogate
from pipeline.inverse.uncertainty import Fit, curvature_certainty, uncertainty

from .linear import CENTRE, GRID, TRUTH, fit, measured, white
from .test_discrepancy import NOTHING, drawn

NONE = Discrepancy(field=0.0, load=0.0)
ENERGY = TRUTH[0] * TRUTH[1] / 2


def hits(found) -> list[bool]:
    pairs = ((found.f_max, TRUTH[0]), (found.delta_max, TRUTH[1]), (found.bond_energy, ENERGY))
    return [low <= truth <= high for (low, high), truth in pairs]


def coverage(errors, objective: Objective, setting: Discrepancy, rigid=Rigid.FIT, draws: int = 300) -> np.ndarray:
    rng = np.random.default_rng(11)
    return np.mean(
        [hits(uncertainty(fit(measured(*errors(rng)), objective, rigid), setting, 0.0)) for _ in range(draws)], axis=0
    )


@pytest.mark.parametrize(("objective", "rigid"), [("fields", "keep"), ("both", "fit")])
def test_white_noise_is_covered(objective, rigid):
    found = coverage(white, Objective(objective), NONE, Rigid(rigid))
    # 300 draws of 95 %: 3 standard errors; 2000 draws gave 94.8–95.6 %
    assert np.all((found > 0.912) & (found < 0.988))


def both_errors(rng: np.random.Generator) -> list[np.ndarray]:
    return [a + b for a, b in zip(drawn(rng, 0.3e-6, 40.0), white(rng), strict=True)]


@pytest.mark.parametrize("objective", [Objective.FIELDS, Objective.LOAD])
def test_correlated_discrepancy_of_known_size_is_covered(objective):
    found = coverage(both_errors, objective, Discrepancy(field=0.3e-6, load=40.0))
    assert np.all((found > 0.912) & (found < 0.988))  # as above


@pytest.mark.parametrize("objective", [Objective.FIELDS, Objective.BOTH])
def test_correlated_discrepancy_of_unknown_size_is_covered(objective):
    found = coverage(both_errors, objective, Discrepancy(), draws=150)
    # the flat prior and Satterthwaite's t are approximations on the wide side
    assert np.all((found > 0.896) & (found <= 1))  # 95 % less 3 standard errors of 150 draws; above is allowed


def test_noise_alone_is_a_lower_bound_that_does_not_cover():
    rng, inside = np.random.default_rng(12), []
    for _ in range(80):
        found = uncertainty(fit(measured(*both_errors(rng)), Objective.FIELDS), Discrepancy(), 0.0)
        low, high = found.noise_only["f_max"]
        assert high - low <= found.f_max[1] - found.f_max[0]
        inside.append(low <= TRUTH[0] <= high)
    assert np.mean(inside) < 0.85  # the reason for the discrepancy: white noise would claim 95 %


def test_white_noise_covariance_is_twice_the_variance_over_the_hessian():
    one = fit(measured(*NOTHING), Objective.FIELDS)
    found = uncertainty(one, NONE, 0.0)
    np.testing.assert_allclose(found.covariance, 2 * 0.4e-6**2 * np.linalg.inv(one.minimum.hessian), rtol=1e-6)
    # exact without residual: H = 2JᵀJ; the rest is round-off of Φ near 1e-24 m²


def test_fields_know_strength_only_relative_to_the_modulus():
    one = fit(measured(*white(np.random.default_rng(1))), Objective.FIELDS)
    extra = uncertainty(one, NONE, 0.08).covariance - uncertainty(one, NONE, 0.0).covariance
    expected = np.diag([(0.08 * one.minimum.position[0]) ** 2, 0.0])
    np.testing.assert_allclose(
        extra, expected, rtol=1e-9, atol=1e-22
    )  # scaling law: f_max follows K, delta_max does not


def test_loads_react_to_the_modulus_as_a_refit_does():
    """A modulus 1 % higher than assumed: the truth looks like f_max/1.01, and its loads are 1.01 times as high."""
    eps = 0.01
    seen = (TRUTH[0] / (1 + eps), TRUTH[1])
    refitted = fit(measured(*NOTHING, load_gain=1 + eps, truth=seen), Objective.LOAD).minimum.position - TRUTH
    one = fit(measured(*NOTHING), Objective.LOAD)
    covariance = uncertainty(one, NONE, eps).covariance - uncertainty(one, NONE, 0.0).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), np.abs(refitted), rtol=0.03)  # first order in 1 %
    assert np.sign(covariance[0, 1]) == np.sign(refitted.prod())


def test_the_product_is_better_known_than_its_factors():
    found = uncertainty(fit(measured(*NOTHING), Objective.FIELDS), NONE, 0.0)
    assert found.correlation < -0.5
    relative = [(high - low) / (high + low) for low, high in (found.f_max, found.delta_max, found.bond_energy)]
    assert relative[2] < relative[0]


def scattered(exact: Fit, size: float, rng: np.random.Generator) -> Fit | None:
    """The fit after Φ has changed from node to node as crack paths change; None where it has no minimum inside."""
    values = exact.surrogate.values + size * rng.standard_normal(GRID.shape)
    surrogate = LagrangeSurrogate(GRID.f_max, GRID.delta_max, values)
    best = minimise(surrogate, np.array([TRUTH]))[0]
    one = Fit(exact.comparison, surrogate, exact.features, exact.load, best)
    return one if best.interior and best.convex else None


def test_scatter_of_the_nodes_is_covered_where_the_curvature_is_certain():
    exact = fit(measured(*NOTHING), Objective.FIELDS)
    rng, inside, sure = np.random.default_rng(13), [], []
    for _ in range(150):
        one = scattered(exact, 1e-3 * np.median(exact.surrogate.values), rng)
        if one is None:
            continue
        scatter = next(c for c in uncertainty(one, NONE, 0.0).budget if c.name == "scatter")
        inside.append(np.abs(one.minimum.position - TRUTH) <= 2.23 * np.sqrt(np.diag(scatter.covariance)))  # t of 10
        sure.append(curvature_certainty(one) > 3)
    inside, sure = np.array(inside), np.array(sure)
    assert sure.sum() > 120
    assert np.all(inside[sure].mean(axis=0) > 0.897)  # 95 % less 3 standard errors of 150 draws


def test_a_valley_lost_in_scatter_is_recognised():
    exact = fit(measured(*NOTHING), Objective.FIELDS)
    rng = np.random.default_rng(14)
    found = [scattered(exact, 0.1 * np.median(exact.surrogate.values), rng) for _ in range(100)]
    unsure = [curvature_certainty(one) < 3 for one in found if one is not None]
    assert np.mean(unsure) > 0.8
    assert curvature_certainty(exact) > 1e3  # a paraboloid scatters by round-off only


def test_intervals_say_what_they_contain_and_what_not():
    one = fit(measured(*white(np.random.default_rng(2))), Objective.BOTH)
    found = uncertainty(one, Discrepancy(load=40.0), 0.05)
    text = " | ".join(found.contains)
    for phrase in (
        "white measuring noise of 0.4 µm",
        "5 N in the load",
        "in the field",
        "40 N in the load",
        "(given)",
        "0.05",
    ):
        assert phrase in text
    assert not any("modulus" in lack for lack in found.lacks)
    assert any("modulus" in lack for lack in uncertainty(one, Discrepancy(), 0.0).lacks)


def test_a_wider_confidence_is_a_wider_interval():
    one = fit(measured(*white(np.random.default_rng(3))), Objective.FIELDS)
    narrow, wide = (uncertainty(one, NONE, 0.0, c) for c in (0.68, 0.99))
    assert wide.f_max[0] < narrow.f_max[0] < TRUTH[0] * 1.2
    assert narrow.f_max[1] < wide.f_max[1]


def test_refusals():
    one = fit(measured(*NOTHING), Objective.FIELDS)
    with pytest.raises(InputError, match=r"modulus_std = -0\.1"):
        uncertainty(one, NONE, -0.1)
    saddle = LagrangeSurrogate(GRID.f_max, GRID.delta_max, -one.surrogate.values)
    best = minimise(saddle, np.array([CENTRE]))[0]
    with pytest.raises(InputError, match="Hessian is not positive definite"):
        uncertainty(Fit(one.comparison, saddle, one.features, one.load, best), NONE, 0.0)
