"""Draws from the metric have its covariance, and a scale of their own where it is unknown."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.gap.metric import Metric

COUNT = 40000


def parts() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    waves = rng.normal(size=(6, 2))
    return np.diag(rng.uniform(0.5, 2.0, 6)), waves @ waves.T


@pytest.mark.parametrize("tail", [np.inf, 8.0])
def test_draws_have_the_covariance_of_noise_and_waves(tail):
    noise, waves = parts()
    found = np.cov(Metric(noise + waves, waves, tail).draws(COUNT, np.random.default_rng(1)))
    exact = noise + waves * (1.0 if np.isinf(tail) else tail / (tail - 2))  # the mean of tail/χ²
    size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.allclose(found / size, exact / size, atol=0.05)  # six standard errors of so many draws, heavy tails


def test_a_draw_has_one_scale_for_all_its_waves():
    """With next to no noise the length of the wave is that of Student's t: its kurtosis is 3 + 6/(tail − 4)."""
    noise, waves = parts()
    drawn = Metric(1e-9 * noise + waves, waves, 20.0).draws(10 * COUNT, np.random.default_rng(1))
    one = drawn[0] / drawn[0].std()
    assert np.mean(one**4) == pytest.approx(3 + 6 / 16, abs=0.1)  # some ten standard errors of the sixth moment's size
    flat = np.linalg.svd(drawn[:, :2000], compute_uv=False)
    assert flat[2] < 1e-3 * flat[1]  # two waves make up all


def test_a_doubted_direction_counts_as_a_wider_covariance():
    """Against the density of the whole matrix, of known and of unknown scale."""
    rng, n = np.random.default_rng(5), 6
    root = rng.standard_normal((n, n))
    sigma, own = root @ root.T + np.eye(n), 0.5 * np.eye(n)
    doubt, residual = rng.standard_normal((n, 2)), rng.standard_normal(n)
    for metric in (Metric(sigma), Metric(sigma, sigma - own, 3.0)):
        wider = Metric(sigma + doubt @ doubt.T, metric.uncertain, metric.tail)
        ours = [metric.log_likelihood(metric.white(k * residual), metric.white(doubt)) for k in (1.0, 3.0)]
        whole = [wider.log_likelihood(wider.white(k * residual)) for k in (1.0, 3.0)]
        assert ours[1] - ours[0] == pytest.approx(whole[1] - whole[0])  # constants of the metrics differ
    assert metric.log_likelihood(metric.white(residual), np.zeros((n, 0))) == metric.log_likelihood(
        metric.white(residual)
    )
