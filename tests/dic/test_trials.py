"""Long tests in small."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.dic.benchmark import Row
from pipeline.dic.trials import large_motion, light, series


def rows(part) -> dict[str, Row]:
    return {row.name.partition(":")[2].strip() or row.name: row for row in part}


def test_large_motion_is_kept():
    found = rows(large_motion(250))
    assert found["points kept"].met
    assert found["rms, px"].value < 0.0115  # as for small motions


def test_a_series_is_kept_in_bounded_memory():
    found = rows(series(5, (220, 260)))
    assert found["points kept"].met
    assert found["rms of the last, px"].value < 0.0115 * np.sqrt(2)  # one renewal at most
    assert found["memory held, MB"].value > 30  # the interpreter and NumPy alone


@pytest.mark.parametrize("gains", [(2.0,), (3.0,)])
def test_much_light_gives_no_wrong_points(gains):
    found = rows(light(gains, 200))
    assert found["pairs"].value == 2
    assert found["wrong share in the others"].met
