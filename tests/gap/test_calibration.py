"""The temperature, in worlds where log Bayes factors are too large by a known factor."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.gap.calibration import Answer, calibrated, expected_error, weights
from pipeline.gap.score import NONE, inclusion

EFFECTS = 5


def answers(count: int, too_sure: float, seed: int = 0) -> list[Answer]:
    """Tests whose exact log Bayes factors are multiplied by `too_sure`.

    An effect shifts its own of five independent normal numbers by d, none shifts none: the exact log Bayes factor of
    effect i is d xᵢ − d²/2.
    """
    rng, d = np.random.default_rng(seed), 3.0
    odds = inclusion(EFFECTS)
    share = np.array([1.0, *[odds] * EFFECTS]) / (1 + EFFECTS * odds)
    found = []
    for k in range(count):
        true = int(rng.choice(EFFECTS + 1, p=share))
        x = rng.standard_normal(EFFECTS) + d * (np.arange(1, EFFECTS + 1) == true)
        bayes = {NONE: 0.0} | {f"effect {i}": float(too_sure * (d * x[i] - d**2 / 2)) for i in range(EFFECTS)}
        found.append(Answer(k % 20, NONE if true == 0 else f"effect {true - 1}", bayes, EFFECTS))
    return found


@pytest.mark.parametrize("too_sure", [1.0, 3.0, 8.0])
def test_the_temperature_is_the_factor_by_which_bayes_factors_are_too_large(too_sure):
    found = calibrated(answers(600, too_sure))
    assert found.temperature == pytest.approx(too_sure, rel=0.25)  # 600 tests; the score is flat about its best
    assert found.cross == pytest.approx(found.log_score, abs=0.02)
    assert found.cold <= found.log_score


def test_at_the_right_temperature_stated_is_achieved():
    given = answers(600, 6.0, seed=1)
    assert expected_error(given, 6.0) < 0.06  # three standard deviations of five bins of 120, in the mean
    assert expected_error(given, 1.0) > 0.1


def test_tests_with_and_without_effects_count_alike():
    given = [Answer(0, NONE, {NONE: 0.0}, 1)] * 9 + [Answer(1, "a", {NONE: 0.0, "a": 1.0}, 1)]
    assert weights(given)[-1] == pytest.approx(0.5)
    assert weights(given).sum() == pytest.approx(1.0)


def test_an_answer_that_was_not_scored_counts_as_improbable_not_as_impossible():
    assert np.isfinite(Answer(0, "b", {NONE: 0.0, "a": 1.0}, 1).log_score(1.0))
