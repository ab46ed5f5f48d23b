"""The offset of the frames, with an error that can be trusted."""

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.dic.synchronise import first_motion, synchronise


def record(rate=8e-6, rest=5.0, end=60.0):
    """At rest, a ramp that slows down after half the time, as a clip gauge sees it."""
    time = np.arange(0, end, 0.05)
    cmod = rate * (np.maximum(time - rest, 0) - 0.5 * np.maximum(time - end / 2, 0))
    return LoadCurve(time, cmod, np.ones_like(time))


def frames(late, noise, seed, gain=1.0, zero=0.0, curve=None):
    curve = curve or record()
    time = np.arange(2.0, 55.0, 0.2)
    seen = gain * np.interp(time - late, curve.time, curve.cmod) + zero
    return time, seen + np.random.default_rng(seed).normal(0, noise, time.size)


@pytest.mark.parametrize("late", [-3.1, 0.0, 0.73, 4.2])
def test_the_offset_is_found(late):
    found = synchronise(*frames(late, 0.4e-6, 1, zero=2e-6), record())
    assert found.offset == pytest.approx(late, abs=5 * found.std)  # five deviations
    assert found.std < 0.05
    assert found.zero == pytest.approx(2e-6, abs=2e-7)  # 0.4 µm / sqrt(265), some of it shared with the offset


def test_the_stated_error_covers_the_truth():
    found = [synchronise(*frames(0.6, 1e-6, seed), record()) for seed in range(60)]
    pull = np.array([(f.offset - 0.6) / f.std for f in found])
    assert 0.75 < pull.std() < 1.3  # 60 draws know their deviation to 9 %; the error of correlated rests is widened


def test_a_clip_gauge_with_another_gain():
    found = synchronise(*frames(1.5, 0.4e-6, 2, gain=1.2), record(), fit_gain=True)
    assert found.offset == pytest.approx(1.5, abs=5 * found.std)  # five deviations
    assert found.gain == pytest.approx(1.2, abs=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_a_part_that_follows_the_load(seed):
    """Arms that bend under the load: without that part in the fit the clock would be seconds off."""
    plain = record()
    load = 3e3 * (plain.cmod / 5e-5) * np.exp(1 - plain.cmod / 5e-5)
    curve = LoadCurve(plain.time, plain.cmod, load)
    time, seen = frames(1.2, 0.4e-6, seed, gain=1.1)
    seen = seen - 12e-6 * np.interp(time - 1.2, curve.time, load / load.max())
    found = synchronise(time, seen, curve, fit_gain=True, fit_bending=True)
    assert found.offset == pytest.approx(1.2, abs=5 * found.std)  # five deviations
    assert found.std < 0.1
    assert found.gain == pytest.approx(1.1, abs=0.01)
    wrong = synchronise(time, seen, curve, fit_gain=True)
    assert abs(wrong.offset - 1.2) > 5 * found.std


def test_a_bare_ramp_cannot_be_synchronised():
    time = np.arange(0, 60, 0.05)
    ramp = LoadCurve(time, 1e-5 * time, np.ones_like(time))
    seen = np.arange(20.0, 40.0, 0.2)
    with pytest.raises((ConvergenceError, InputError)):
        synchronise(seen, 1e-5 * (seen - 0.5) + np.random.default_rng(0).normal(0, 1e-7, seen.size), ramp)


def test_clocks_that_do_not_overlap_are_refused():
    time, seen = frames(0.0, 1e-7, 0)
    with pytest.raises(InputError, match="overlap"):
        synchronise(time + 1e4, seen, record())
    with pytest.raises(InputError, match="at least 8"):
        synchronise(time[:5], seen[:5], record())


@pytest.mark.parametrize("late", [-2.0, 0.6])
def test_a_record_whose_waiting_time_was_cut_off(late):
    whole = record()
    moving = whole.time >= 5.0
    curve = LoadCurve(*(values[moving] for values in (whole.time, whole.cmod, whole.load)))
    found = synchronise(*frames(late, 0.4e-6, 3), curve)
    assert found.offset == pytest.approx(late, abs=5 * found.std)  # five deviations
    assert found.std < 0.05


def test_missing_frames_do_not_matter():
    time, seen = frames(0.73, 0.4e-6, 1)
    seen[::3] = np.nan
    found = synchronise(time, seen, record())
    assert found.offset == pytest.approx(0.73, abs=5 * found.std)  # five deviations


def test_first_motion_is_the_kink():
    time = np.arange(0, 20, 0.1)
    pulls = []
    for seed in range(40):
        signal = np.maximum(time - 7.3, 0) + np.random.default_rng(seed).normal(0, 0.1, time.size)
        kink, std = first_motion(time, signal)
        pulls.append((kink - 7.3) / std)
    assert abs(np.mean(pulls)) < 0.5  # three deviations of the mean of 40
    assert 0.7 < np.std(pulls) < 1.4  # three deviations of the deviation of 40


def test_no_motion_is_said():
    with pytest.raises(ConvergenceError, match="no first motion"):
        first_motion(np.arange(100.0), np.random.default_rng(0).normal(size=100))
