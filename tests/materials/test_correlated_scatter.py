"""Covariance of linear fits with independent and correlated errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from pipeline.materials.correlated_scatter import correlated_scatter

X = np.linspace(-1, 1, 60)
LINE = np.column_stack([np.ones_like(X), X])


def autoregression(random: np.random.Generator, count: int, rho: float) -> np.ndarray:
    out = random.normal(size=count)
    for k in range(1, count):
        out[k] = rho * out[k - 1] + np.sqrt(1 - rho**2) * out[k]
    return out


def residual_of(errors: np.ndarray, design: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a fit of a line leaves of errors, and how far its constants are off."""
    beta, *_ = np.linalg.lstsq(design, errors, rcond=None)
    return design @ beta - errors, beta


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.85])
def test_intervals_of_a_line_hold_the_truth(rho):
    random, held = np.random.default_rng(2), []
    for _ in range(80):
        residual, beta = residual_of(autoregression(random, X.size, rho), LINE)
        found = correlated_scatter(residual, LINE, X)
        half = student.ppf(0.975, found.degrees) * np.sqrt(np.diag(found.covariance))
        held.append(np.abs(beta) <= half)
    share = np.mean(held, axis=0)
    assert (share > 0.84).all()  # 95 % of 80, and what is not known of ρ; fewer has a chance of 2e-3 at 0.93


def test_independent_errors_give_the_textbook_covariance():
    random, ratio = np.random.default_rng(0), []
    for _ in range(40):
        residual, _ = residual_of(random.normal(size=X.size), LINE)
        found = correlated_scatter(residual, LINE, X)
        textbook = residual @ residual / (X.size - 2) * np.linalg.inv(LINE.T @ LINE)
        assert found.independent == pytest.approx(textbook, rel=1e-9, abs=1e-15)  # a solve
        ratio.append(np.diag(found.covariance) / np.diag(textbook))
    assert 1 < np.mean(ratio) < 1.6  # larger by what ρ might be: about (1 + 0.13)/(1 − 0.13)


def test_the_correlation_is_found():
    random = np.random.default_rng(1)
    for rho in (0.3, 0.8):
        found = [
            correlated_scatter(residual_of(autoregression(random, X.size, rho), LINE)[0], LINE, X).correlation
            for _ in range(30)
        ]
        assert np.mean(found) == pytest.approx(rho, abs=0.12)  # 60 readings; the prior pulls to the middle


def test_replicates_count_as_one_reading():
    residual, _ = residual_of(np.random.default_rng(3).normal(size=X.size), LINE)
    twice = correlated_scatter(np.repeat(residual, 2), np.repeat(LINE, 2, axis=0), np.repeat(X, 2))
    once = correlated_scatter(residual, LINE, X)
    assert twice.covariance == pytest.approx(once.covariance, rel=1e-9, abs=1e-15)  # the same sums


def test_many_readings_are_averaged_in_runs():
    x = np.linspace(-1, 1, 6000)
    line = np.column_stack([np.ones_like(x), x])
    residual, _ = residual_of(np.random.default_rng(4).normal(size=x.size), line)
    found = correlated_scatter(residual, line, x)
    textbook = residual @ residual / x.size * np.linalg.inv(line.T @ line)
    assert np.diag(found.covariance) == pytest.approx(np.diag(textbook), rel=0.4)  # 300 runs


def test_an_exact_fit_has_no_scatter():
    found = correlated_scatter(np.zeros(X.size), LINE, X)
    assert (found.covariance == 0).all()
