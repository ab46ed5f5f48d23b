"""Fixtures for every room."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

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
