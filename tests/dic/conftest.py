"""The correlation needs its compiled core."""

from __future__ import annotations

import pytest

from pipeline.core.errors import ToolchainError
from pipeline.dic.core import core
from pipeline.dic.settings import Settings


@pytest.fixture(scope="session", autouse=True)
def compiled_core():
    try:
        return core()
    except ToolchainError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def one_core() -> Settings:
    return Settings(threads=1)
