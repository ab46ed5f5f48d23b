"""When a virtual test is recorded: rest, ramp, and images that know nothing of the record's rows."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from pipeline.core.units import MM
from pipeline.twin.virtual_test import Recording

RATE = 0.5 * MM / 60


def test_without_a_rest_the_frames_run_from_zero_to_the_end():
    recording = Recording(RATE, 0.6 * MM)
    np.testing.assert_allclose(recording.frame_time, np.linspace(0, 72, 61))
    np.testing.assert_allclose(recording.frame_cmod, np.linspace(0, 0.6 * MM, 61), atol=1e-12)


@pytest.mark.parametrize("phase", [0.0, 0.3, 1.0])
def test_with_a_rest_frames_before_it_show_no_opening(phase):
    recording = Recording(RATE, 0.6 * MM, frames=41, before=4, phase=phase, rest=10.0)
    time, cmod = recording.frame_time, recording.frame_cmod
    assert time.size == 45
    np.testing.assert_allclose(np.diff(time), 1.8)  # 72 s in 40 steps
    np.testing.assert_array_equal(cmod[time <= 10.0], 0.0)
    assert np.count_nonzero(cmod == 0) == 5 + (phase == 1.0)
    np.testing.assert_allclose(cmod[time > 10], (time[time > 10] - 10) * RATE)
    assert cmod[-1] == pytest.approx(0.6 * MM - phase * 1.8 * RATE)


@pytest.mark.parametrize("wrong", [{"before": -1}, {"phase": 1.5}, {"phase": float("nan")}, {"rest": -1.0}])
def test_impossible_times_are_refused(wrong):
    with pytest.raises(InputError, match="must not be negative"):
        Recording(RATE, 0.6 * MM, **wrong)
