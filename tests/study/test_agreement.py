"""Measures of agreement on numbers a reader can redo."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.study.agreement import Check, curve_difference, field_difference, order_of_convergence


def curve(load: list[float]) -> LoadCurve:
    return LoadCurve(np.arange(3.0), np.array([0.0, 1.0, 2.0]), np.array(load))


def test_curves_differ_by_the_norm_at_the_stations() -> None:
    at = np.array([1.0, 2.0])
    # (0.3, 0.4) over (3, 4)
    assert curve_difference(curve([0, 3.3, 4.4]), curve([0, 3, 4]), at) == pytest.approx(0.1, rel=1e-12)  # round-off


def test_fields_differ_by_the_worst_station() -> None:
    limit = np.ones((2, 3, 2))
    seen = limit.copy()
    seen[1, 0, 0] += 0.5
    assert field_difference(seen, limit) == pytest.approx(0.5 / np.sqrt(6), rel=1e-12)  # round-off
    seen[1, 0, 0] = np.nan  # a point that one of both does not have
    assert field_difference(seen, limit) == 0
    assert np.isnan(field_difference(seen[:1], limit)), "a station that one run did not reach"


def test_order_of_a_power() -> None:
    steps = np.array([10.0, 20.0, 80.0])
    assert order_of_convergence(steps, 3 * steps**-1.5) == pytest.approx(1.5, rel=1e-12)  # round-off


def test_a_check_without_a_number_fails() -> None:
    assert not Check("a", "b", float("nan"), 1.0, "c").passed
    assert Check("a", "b", 0.0, 0.0, "c").passed
