"""The evidence against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from pipeline.gap.candidate import Candidate
from pipeline.gap.effect import Magnitude
from pipeline.gap.fit import Data, fit
from pipeline.gap.metric import Metric
from pipeline.gap.noise import noise_bic
from pipeline.gap.observation import Observation, Reading, Sight
from tests.gap.linear import BOX, WIDE, candidate, covariance, data, exact_log_bayes, none, restricted


def scene(seed: int, size: float = 1.0):
    rng = np.random.default_rng(seed)
    n = 40
    base, column, sigma = rng.normal(size=(n, 2)), rng.normal(size=n), covariance(n, rng)
    target = base @ [1.0, -2.0] + size * column + np.linalg.cholesky(sigma) @ rng.normal(size=n)
    return base, column, sigma, target


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [0.0, 0.3, 3.0])
def test_the_bayes_factor_of_a_linear_effect_is_the_exact_one(seed, size):
    base, column, sigma, target = scene(seed, size)
    given = data(target, sigma)
    found = fit(candidate(base, "x", column), given).log_evidence - fit(none(base), given).log_evidence
    exact = exact_log_bayes(target, sigma, base, column, WIDE.scale)
    assert found == pytest.approx(exact, abs=0.01)  # trapezoids of 0.42 standard deviations, cut at five


def test_the_posterior_of_a_linear_effect_is_the_exact_one():
    base, column, sigma, target = scene(3, 2.0)
    found = fit(candidate(base, "x", column), data(target, sigma))
    design, inverse = np.column_stack([base, column]), np.linalg.inv(sigma)
    precision = design.T @ inverse @ design + np.diag([0, 0, 1 / WIDE.scale**2])
    mean = np.linalg.solve(precision, design.T @ inverse @ target)
    std = np.sqrt(np.linalg.inv(precision)[2, 2])
    assert found.values()[0] == pytest.approx(mean[2], abs=0.01 * std)  # quadrature
    assert np.allclose(found.amplitudes, mean[2], atol=1e-4 * std)  # Gauss–Newton is exact in one step
    low, high = found.interval()[0]
    assert (high - low) / 2 == pytest.approx(1.96 * std, rel=0.03)  # quantiles between nodes 0.42 std apart


def test_temper_widens_the_interval_by_its_root():
    base, column, sigma, target = scene(3, 2.0)
    flat = Magnitude(-50.0, 50.0, 1e6, "1")  # the prior has no say
    found = fit(candidate(base, "x", column, flat), data(target, sigma))
    (low, high), (lower, higher) = found.interval()[0], found.interval(temperature=2.5)[0]
    assert (higher - lower) / (high - low) == pytest.approx(np.sqrt(2.5), rel=0.03)  # nodes reach 3.2 wider deviations
    assert found.values(2.5)[0] == pytest.approx(found.values()[0], abs=1e-3 * (high - low))


def test_the_interval_of_parameters_is_the_exact_one():
    base, column, sigma, target = scene(3, 2.0)
    found = fit(candidate(base, "x", column), data(target, sigma))
    design, inverse = np.column_stack([base, column]), np.linalg.inv(sigma)
    std = np.sqrt(np.diag(np.linalg.inv(design.T @ inverse @ design + np.diag([0, 0, 1 / WIDE.scale**2]))))[:2]
    low, high = found.parameter_interval().T
    assert np.allclose((high - low) / 2, 1.959964 * std, rtol=1e-5)  # central differences of a linear function
    wide = found.parameter_interval(temperature=4.0)
    assert np.allclose(wide.mean(axis=1), found.parameters)
    assert (np.ptp(wide, axis=1) > high - low).all()


def test_two_effects_at_once_have_the_exact_evidence():
    base, column, sigma, target = scene(5, 1.0)
    other = np.random.default_rng(9).normal(size=column.size)
    both = Candidate(("x", "z"), (WIDE, WIDE), lambda p, a: base @ p + column * a[0] + other * a[1])
    given = data(target, sigma)
    found = fit(both, given).log_evidence - fit(none(base), given).log_evidence
    first = exact_log_bayes(target, sigma, base, column, WIDE.scale)
    with_first = sigma + WIDE.scale**2 * np.outer(column, column)
    exact = first + exact_log_bayes(target, with_first, base, other, WIDE.scale)
    assert found == pytest.approx(exact, abs=0.02)  # midpoints 0.7 standard deviations apart


@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_an_effect_that_is_doubted_has_the_exact_evidence(size):
    """What is uncertain in proportion to the value widens the covariance at every value, along the parameters too."""
    base, column, sigma, target = scene(6, 1.0)
    doubt = size * (np.random.default_rng(3).normal(size=column.size) + base[:, 0])
    unsure = replace(candidate(base, "x", column), doubt=lambda a: np.outer(doubt, a))
    given = data(target, sigma)
    found = fit(unsure, given).log_evidence - fit(none(base), given).log_evidence
    line = np.linspace(-8, 8, 801) * WIDE.scale
    terms = [restricted(target - a * column, sigma + a**2 * np.outer(doubt, doubt), base) for a in line]
    prior = -0.5 * (line / WIDE.scale) ** 2 - np.log(WIDE.scale * np.sqrt(2 * np.pi))
    exact = logsumexp(terms + prior) + np.log(line[1] - line[0]) - restricted(target, sigma, base)
    assert found == pytest.approx(exact, abs=0.05)  # the nodes of a quadrature


def test_an_effect_that_data_do_not_see_keeps_its_prior():
    base, column, sigma, target = scene(1)
    size = Magnitude(0.0, 2.0, 1e6, "1")  # flat between the bounds
    found = fit(candidate(base, "x", 0 * column, size), data(target, sigma))
    assert found.log_evidence == pytest.approx(fit(none(base), data(target, sigma)).log_evidence, abs=1e-6)
    assert np.allclose(found.interval()[0], (0.05, 1.95), atol=0.04)  # thirteen nodes over the range


def test_amplitudes_stay_within_their_bounds():
    base, column, sigma, target = scene(2, 5.0)
    size = Magnitude(0.0, 1.0, 1e6, "1")
    found = fit(candidate(base, "x", column, size), data(target, sigma))
    assert found.amplitudes[0] == pytest.approx(1.0)
    assert found.nodes.max() <= 1.0


def test_a_curved_effect_is_found_from_the_far_side():
    rng = np.random.default_rng(4)
    t = np.linspace(0, 1, 60)
    base = np.column_stack([np.ones_like(t), t])
    bent = Candidate(("x",), (Magnitude(-3, 3, 1e6, "1"),), lambda p, a: base @ p + np.sin(4 * a[0] * t))
    target = bent.predict(np.array([0.5, -1.0]), np.array([2.0])) + 0.05 * rng.normal(size=t.size)
    found = fit(bent, Data(target, Metric(0.05**2 * np.eye(t.size)), BOX))
    assert found.amplitudes[0] == pytest.approx(2.0, abs=0.05)  # ten times its standard deviation


def test_against_noise_alone_the_criterion_is_that_of_least_squares():
    """χ² + k ln n of linear least squares, whatever the discrepancy was said to be."""
    rng = np.random.default_rng(0)
    n, base, column = 40, rng.normal(size=(40, 2)), rng.normal(size=40)
    reading = Reading(np.full((n, 1, 2), np.nan), base @ [1.0, -2.0] + column + 0.5 * rng.normal(size=n))
    seen = Sight(
        cmod=np.arange(1.0, n + 1), time=np.arange(1.0, n + 1), points=np.zeros((1, 2)), side=np.ones(1),
        tip=np.zeros(2), peak_cmod=1.0, centre=np.zeros(2), corner=1.0, pull=np.zeros(2), end_cmod=1.0,
    )  # fmt: skip
    test = Observation(seen, reading, np.full((n, 1), np.nan), np.full(n, 0.5))
    given = data(reading.load, covariance(n, rng))
    fits = {c.label: fit(c, given) for c in (none(base), candidate(base, "x", column, Magnitude(-50, 50, 1e6, "1")))}
    found = noise_bic(test, given, fits)
    for label, design in (("none", base), ("x", np.column_stack([base, column]))):
        left = reading.load - design @ np.linalg.lstsq(design, reading.load, rcond=None)[0]
        assert found[label] == pytest.approx(4 * left @ left + design.shape[1] * np.log(n), rel=1e-6)  # one linear step
    assert found["x"] < found["none"]


def test_the_order_of_data_does_not_matter():
    base, column, sigma, target = scene(7)
    order = np.random.default_rng(0).permutation(target.size)
    one = fit(candidate(base, "x", column), data(target, sigma))
    two = fit(candidate(base[order], "x", column[order]), data(target[order], sigma[np.ix_(order, order)]))
    assert one.log_evidence == pytest.approx(two.log_evidence, abs=1e-8)  # round-off of two factorisations
