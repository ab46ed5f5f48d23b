"""The library's entry from specimens left out, in worlds whose discrepancy is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.gap.discrepancy import ALL, KNOTS, Discrepancy
from pipeline.gap.fit import Data, fit
from pipeline.gap.learning import Remnant, local_factor
from pipeline.gap.metric import Metric
from pipeline.gap.observation import Observation, Reading
from pipeline.gap.score import NONE, score
from pipeline.gap.selection import FACTORS, Rest, log_share, restricted, scale_of, selected
from tests.gap.linear import BOX, candidate, covariance, none
from tests.gap.scene import discrepancy, sight

SCALE = 3000.0


def rest(model: Discrepancy, rng: np.random.Generator, modes: float = 1.0, local: float = 1.0) -> Rest:
    """A test that is left with a draw of a discrepancy, of its own scales, and noise."""
    seen = sight()
    cov = model.scaled(modes, local).covariance(seen, SCALE)
    wave = np.linalg.cholesky(cov + 1e-9 * np.diag(np.diag(cov))) @ rng.standard_normal(len(cov))
    s, p = seen.cmod.size, len(seen.points)
    cut = 2 * s * p
    field = wave[:cut].reshape(s, p, 2) + 0.4e-6 * rng.standard_normal((s, p, 2))
    load = wave[cut:] + 5.0 * rng.standard_normal(s)
    seen_there = Observation(seen, Reading(field, load), np.full((s, p), 0.4e-6), np.full(s, 5.0))
    n = cut + s
    return Rest(Remnant(seen_there, SCALE), rng.standard_normal((n, 2)), np.zeros((n, n)))


def test_a_scale_that_differs_from_specimen_to_specimen_is_found():
    rng, tail = np.random.default_rng(0), 4.0
    densities = []
    for _ in range(150):
        factor = tail / rng.chisquare(tail)
        wave = np.sqrt(0.1 + factor) * rng.standard_normal(30)
        densities.append(restricted(wave, rng.standard_normal((30, 2)), 0.1 * np.eye(30), np.eye(30)))
    found = scale_of(densities)
    assert found.typical == pytest.approx(1.0, rel=0.3)  # 150 scales, each known to a quarter
    assert 2.0 <= found.tail <= 8.0


def test_the_restricted_density_does_not_hang_on_the_parameters():
    rng = np.random.default_rng(1)
    slopes, left = rng.standard_normal((20, 2)), rng.standard_normal(20)
    one = restricted(left, slopes, np.eye(20), np.eye(20))
    two = restricted(left + slopes @ [3.0, -5.0], slopes, np.eye(20), np.eye(20))
    assert np.allclose(one, two, atol=1e-8)  # round-off


def test_shares_of_factors_are_a_probability():
    share = np.exp(log_share(0.7, 5.0))
    assert share.sum() == pytest.approx(1.0)
    mean = 0.7 * 5 / 3  # of the inverse χ² distribution
    assert share @ FACTORS == pytest.approx(mean, rel=0.05)  # steps of 30 %, and an end at fifty


def test_local_scatter_is_measured_beside_the_modes():
    rng, model = np.random.default_rng(2), discrepancy()
    found = [local_factor(rest(model, rng, modes=4.0, local=k).remnant.observation, model) for k in (0.5, 1.0, 3.0)]
    assert np.allclose(found, (0.5, 1.0, 3.0), rtol=0.35)  # some twenty independent differences


@pytest.mark.slow
def test_an_entry_learnt_from_eight_fits_those_left_out():
    rng, model = np.random.default_rng(3), discrepancy()
    found = selected([rest(model, rng, np.sqrt(6 / rng.chisquare(6))) for _ in range(8)], shares=(0.4,), placed=(0.0,))
    assert all(0.5 < value < 2 for value in found.check.values())
    size = found.discrepancy.amplitude / model.amplitude
    assert np.median(size) == pytest.approx(1.0, rel=0.5)  # eight specimens of unequal scale


def test_a_mode_that_is_too_narrow_is_widened_and_only_that():
    """Amplitudes, and the specimens' own waves, in which a mode differs."""
    wider = np.ones(len(ALL))
    wider[-1] = 1.5
    one = replace(discrepancy(), waves=np.ones((2, len(ALL), KNOTS.size)), empirical=0.3)
    before, after = (d.of_modes(sight(), SCALE) for d in (one, one.widened(wider)))
    cut = -sight().cmod.size
    np.testing.assert_allclose(after[cut:, cut:], 1.5**2 * before[cut:, cut:])
    np.testing.assert_allclose(after[:cut, :cut], before[:cut, :cut])
    np.testing.assert_allclose(after[:cut, cut:], 1.5 * before[:cut, cut:])


def test_common_waves_are_not_spread_over_all_shapes():
    """What all specimens have alike is expected of the next one; what none has is not."""
    common = np.zeros((1, len(ALL), KNOTS.size))
    common[0, 1] = 5e-6 * KNOTS / KNOTS[-1]
    model = replace(discrepancy(), waves=common, empirical=0.9)
    size = np.sqrt(np.diag(model.of_modes(sight(), SCALE)))
    rows = size[: -sight().cmod.size].reshape(sight().cmod.size, -1, 2)
    assert rows[-1, :, 1].min() > rows[-1, :, 0].max()  # along y, not along x


@pytest.mark.slow
def test_probabilities_are_what_happens_when_scales_differ():
    """Effects from the prior, specimens of unequal scale: a metric that knows of it is calibrated."""
    rng, tail, n = np.random.default_rng(4), 3.0, 24
    base, columns, sigma = rng.normal(size=(n, 2)), 0.8 * rng.normal(size=(n, 4)), covariance(n, rng)
    small = 1e-3 * np.eye(n)
    knowing, naive = Metric(sigma + small, sigma, tail), Metric(sigma + small)
    root, stated, right = np.linalg.cholesky(sigma), {0: [], 1: []}, {0: [], 1: []}
    for _ in range(100):
        true = int(rng.integers(-4, 4))
        target = base @ rng.uniform(-5, 5, 2) + np.sqrt(tail / rng.chisquare(tail)) * (root @ rng.standard_normal(n))
        if true >= 0:
            target = target + columns[:, true] * 1.5 * rng.standard_normal()
        for k, metric in enumerate((knowing, naive)):
            given = Data(target, metric, BOX)
            evidence = {NONE: fit(none(base), given).log_evidence}
            evidence |= {f"{i}": fit(candidate(base, f"{i}", columns[:, i]), given).log_evidence for i in range(4)}
            found = score(evidence, 4)
            top = found.ranked()[0]
            stated[k].append(found.probability[top])
            right[k].append(top == (NONE if true < 0 else f"{true}"))
    # three standard deviations of 100 trials: 0.13; singles have a little more than half the prior, 0.03
    assert np.mean(right[0]) == pytest.approx(np.mean(stated[0]), abs=0.16)
    assert np.mean(stated[1]) - np.mean(right[1]) > np.mean(stated[0]) - np.mean(right[0])  # too sure
