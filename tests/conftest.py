"""Fixtures for every room."""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path

import pytest
from helpers.bundles import make_bundle
from helpers.films import make_film
from hypothesis import settings

settings.register_profile("busy", deadline=None)  # no test asserts seconds: other work may share the machine
settings.load_profile("busy")

pytest.register_assert_rewrite("helpers.refusals")  # what differs is told, as in the tests themselves

# what a shell starts in its background ignores interrupts, and so would every program started here
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured and challenge data; set COHESIVE_BPM_DATA where it lies elsewhere."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("COHESIVE_BPM_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"no measured data at {folder}: set COHESIVE_BPM_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle in which nothing is wrong, and which is only copied."""
    return make_bundle(tmp_path_factory.mktemp("bundles") / "coarse")


@pytest.fixture
def bundle(sound: Path, tmp_path: Path) -> Path:
    """A copy of the sound bundle to be spoilt."""
    return Path(shutil.copytree(sound, tmp_path / "bundle"))


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual test in images, which is only copied."""
    return make_film(tmp_path_factory.mktemp("films") / "film")
