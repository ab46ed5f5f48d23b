"""A beam small enough to be broken in a second."""

from __future__ import annotations

import os
from collections.abc import Iterator
from unittest import mock

import pytest
from helpers.beams import small_beam

from pipeline.core.problem import Problem


@pytest.fixture(scope="session")
def beam() -> Problem:
    """A two-phase SE(B) of some 1,700 particles."""
    return small_beam()


@pytest.fixture(scope="session", autouse=True)
def ranks_that_wait_sleep() -> Iterator[None]:
    """MPICH polls while it waits: on processors that others use as well, ranks would wait for each other's turns."""
    throttle = {
        "MPIR_CVAR_CH4_PROGRESS_THROTTLE": "1",
        "MPIR_CVAR_CH4_PROGRESS_THROTTLE_NO_PROGRESS_COUNT": "50",
    }
    with mock.patch.dict(os.environ, throttle):
        yield
