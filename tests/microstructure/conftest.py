"""Specimens of the paper."""

import pytest

from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam


@pytest.fixture(scope="session")
def beam():
    return SingleEdgeNotchedBeam(depth=0.06, span=0.13, length=0.137, thickness=0.04, notch_length=0.015)


@pytest.fixture(scope="session")
def disk():
    return DiskCompactTension(
        diameter=0.15, width=0.11, edge_to_load_line=0.035, thickness=0.05, notch_length=0.0275, notch_width=1.5e-3
    )
