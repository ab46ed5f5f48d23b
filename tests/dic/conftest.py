"""Settings that most tests of the correlation share."""

from __future__ import annotations

import pytest

from pipeline.dic.settings import Settings


@pytest.fixture(scope="session")
def one_core() -> Settings:
    return Settings(threads=1)
