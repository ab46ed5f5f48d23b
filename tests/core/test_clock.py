"""Physical time of an opening."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.clock import Clock, steady
from pipeline.core.errors import InputError


def test_times_between_beyond_and_before_the_points() -> None:
    clock = Clock(np.array([0, 1e-4, 3e-4]), np.array([0, 20.0, 30.0]))
    openings = [-1e-5, 0, 5e-5, 1e-4, 2e-4, 3e-4, 5e-4]
    expected = [0, 0, 10, 20, 25, 30, 40]  # 5 s to 1e-4 m, and on so
    assert [clock.at(c) for c in openings] == pytest.approx(expected, rel=1e-15)  # a product and a sum


def test_a_steady_test() -> None:
    assert steady(0.5e-3 / 60).at(0.1e-3) == pytest.approx(12, rel=1e-14)  # 0.5 mm/min: three quotients


@pytest.mark.parametrize(
    ("cmod", "time"), [([0, 1], [0, 0]), ([0, 0, 1], [0, 1, 2]), ([1, 2], [0, 1]), ([0], [0]), ([0, 1], [0, 1, 2])]
)
def test_what_is_no_clock_is_refused(cmod: list[float], time: list[float]) -> None:
    with pytest.raises(InputError, match=r"of a clock must be two or more|a clock needs one finite time"):
        Clock(np.array(cmod), np.array(time))


def test_standing_still_is_refused() -> None:
    with pytest.raises(InputError, match=r"cmod_rate = 0 m/s must be positive"):
        steady(0.0)
