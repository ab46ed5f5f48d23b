"""A beam small enough to be broken in a second."""

from __future__ import annotations

import pytest
from helpers.beams import small_beam

from pipeline.core.problem import Problem


@pytest.fixture(scope="session")
def beam() -> Problem:
    """A two-phase SE(B) of some 1,700 particles."""
    return small_beam()
