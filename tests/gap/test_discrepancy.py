"""Modes and discrepancy: what is put in is found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.gap.discrepancy import ALL
from pipeline.gap.gate import gate, mode_operators
from pipeline.gap.learning import Remnant, learn
from pipeline.gap.metric import Metric
from pipeline.gap.modes import MODES, amplitudes, shapes
from pipeline.gap.observation import Observation, Reading
from tests.gap.scene import discrepancy, sight

SCALE = 3000.0


def drawn(model, rng, noise=0.4e-6) -> Remnant:
    """A test that is left with the discrepancy of a model, and noise."""
    seen = sight()
    cov = model.covariance(seen, SCALE)
    s, p = seen.cmod.size, len(seen.points)
    wave = np.linalg.cholesky(cov + 1e-18 * np.diag(np.ones(len(cov))) * np.diag(cov)) @ rng.standard_normal(len(cov))
    cut = 2 * s * p
    field = wave[:cut].reshape(s, p, 2) + noise * rng.standard_normal((s, p, 2))
    load = wave[cut:] + 5.0 * rng.standard_normal(s)
    return Remnant(Observation(seen, Reading(field, load), np.full((s, p), noise), np.full(s, 5.0)), SCALE)


def test_every_mode_is_taken_apart_again():
    seen = sight()
    basis = shapes(seen).reshape(-1, len(MODES))
    assert np.linalg.matrix_rank(basis) == len(MODES)
    take = amplitudes(seen, np.ones((1, len(seen.points))))[0]
    assert np.allclose(take @ basis, np.eye(len(MODES)), atol=1e-9)  # round-off of a pseudo-inverse


def test_rigid_motion_is_rigid_and_opening_opens():
    seen = sight()
    rotation, opening = shapes(seen)[..., 2], shapes(seen)[..., 6]
    arm = seen.points - seen.tip
    assert np.allclose(np.sum(rotation * arm, axis=1), 0, atol=1e-15)  # exact: at right angles to the arm
    right, left = opening[seen.side > 0, 0], opening[seen.side < 0, 0]
    assert np.allclose(right - left, 1.0)


def test_the_covariance_is_one():
    cov = discrepancy().covariance(sight(), SCALE)
    assert np.array_equal(cov, cov.T)
    assert np.linalg.eigvalsh(cov).min() > -1e-9 * np.linalg.eigvalsh(cov).max()  # round-off


def test_the_covariance_has_the_amplitudes_that_were_asked_for():
    seen, model = sight(), discrepancy()
    cov = model.covariance(seen, SCALE)
    load = np.sqrt(np.diag(cov)[-seen.cmod.size :])
    assert load[-1] == pytest.approx(0.03 * SCALE)
    half = replace(seen, cmod=0.5 * seen.cmod)
    load = np.sqrt(np.diag(model.covariance(half, SCALE))[-seen.cmod.size :])
    assert load[0] == pytest.approx(0.03 * SCALE * 0.5)  # an eighth of the peak's CMOD, half way to the first knot


def test_what_was_put_in_is_learnt_again():
    rng, truth = np.random.default_rng(0), discrepancy()
    found = learn([drawn(truth, rng) for _ in range(60)])
    # 60 specimens, each with one to three independent waves a stage: a tenth in the amplitudes
    assert np.allclose(found.amplitude[:, 1:] / truth.amplitude[:, 1:], 1.0, atol=0.3)
    assert found.remainder[2] == pytest.approx(truth.remainder[2], rel=0.2)
    assert 0.25e-3 < found.length < 0.65e-3  # truth 0.4e-3
    away = found.correlation - np.eye(len(ALL))
    assert np.abs(away).max() < 0.35  # three standard deviations of a correlation of 60 × 2 waves


def test_left_out_specimens_have_chi_square_of_their_freedom():
    rng, truth = np.random.default_rng(1), discrepancy()
    model = learn([drawn(truth, rng) for _ in range(20)])
    ratios: dict[str, list[float]] = {}
    passed = []
    for _ in range(30):
        rest = drawn(truth, rng)
        o = rest.observation
        cov = (model.covariance(o.sight, SCALE) + np.diag(o.noise))[np.ix_(o.mask, o.mask)]
        found = gate(o, o.reading.flat()[o.mask], cov, model.samples)
        passed.append(found.passed)
        for mode, ratio in found.ratio.items():
            ratios.setdefault(mode, []).append(ratio)
    for mode, values in ratios.items():
        assert 0.5 < np.mean(values) < 2, mode  # the range in which the library counts as honest
    assert np.mean(passed) > 0.85  # 0.99 wanted; three standard deviations of 30 trials below


def test_the_gate_names_the_mode_that_is_too_large():
    rng, model = np.random.default_rng(2), discrepancy()
    rest = drawn(model, rng)
    o = rest.observation
    wrong = 40e-6 * (o.sight.cmod / o.sight.cmod.max())[:, None, None] * shapes(o.sight)[..., 6]
    reading = Reading(o.reading.field + wrong, o.reading.load)
    cov = (model.covariance(o.sight, SCALE) + np.diag(o.noise))[np.ix_(o.mask, o.mask)]
    found = gate(replace(o, reading=reading), reading.flat()[o.mask], cov, model.samples)
    assert found.failed[0] == "opening"


def test_operators_take_what_is_there():
    o = drawn(discrepancy(), np.random.default_rng(3)).observation
    field = o.reading.field.copy()
    field[4, :3] = np.nan
    cut = replace(o, reading=Reading(field, o.reading.load))
    operators = mode_operators(cut)
    assert set(operators) == {*MODES, "remainder", "load"}
    assert all(operator.shape[1] == cut.mask.sum() for operator in operators.values())
    white = Metric(np.diag(cut.noise[cut.mask])).white(cut.reading.flat()[cut.mask])
    assert np.isfinite(white).all()


def test_two_specimens_are_too_few():
    with pytest.raises(InputError, match="at least three"):
        learn([drawn(discrepancy(), np.random.default_rng(k)) for k in range(2)])
