"""The table of trials: what stands at its foot."""

from __future__ import annotations

import numpy as np

from pipeline.study.trials import Trial, trial_table


def trial(f_max: float, delta_max: float) -> Trial:
    return Trial("", f_max, delta_max, f_max * delta_max, (1.0, 1.0), True, False, True, 0.0, 1.0)


def test_means_are_of_factors_with_the_standard_error_of_the_mean() -> None:
    table = trial_table([trial(0.8, 1.0), trial(1.25, 1.0)])
    error = np.log(1.25)  # of two: half their distance
    told = f"+0.0% ± {error:.1%}"
    assert f"| **geometric mean ± standard error** | {told} | +0.0% ± 0.0% | {told} |" in table


def test_one_trial_has_no_standard_error() -> None:
    assert "standard error" not in trial_table([trial(0.9, 1.0)])
