"""The laws in C++, compiled once."""

from __future__ import annotations

import pytest

from .following import Follow, compiled


@pytest.fixture(scope="session")
def cpp(tmp_path_factory: pytest.TempPathFactory) -> Follow:
    """A law in C++ along a path (steps, 3): forces, stored, used up, delta_reached, damage, progress."""
    return compiled(tmp_path_factory.mktemp("law"))
