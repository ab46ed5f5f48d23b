"""The fracture energy of D7313 beside every simulated test."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.specimen import DiskCompactTension
from pipeline.core.units import MM
from pipeline.study.simulate import cmod_energy

DISK = DiskCompactTension(
    diameter=150 * MM, width=110 * MM, edge_to_load_line=35 * MM, thickness=50 * MM, notch_length=27.5 * MM
)


def test_a_triangle_of_known_energy():
    # 3 kN at 0.1 mm, zero at 1.6 mm, without the last 100 N: over 82.5 mm × 50 mm
    curve = LoadCurve(np.arange(3.0), np.array([0, 0.1, 1.6]) * MM, np.array([0, 3000.0, 0]))
    found = cmod_energy(curve, DISK)
    assert found["cmod_fracture_energy_j_per_m2"] == pytest.approx((2.4 - 0.0025) / 4.125e-3, rel=1e-12)  # a quotient
    assert found["cmod_fracture_energy_complete"] is True
    assert cmod_energy(curve.until(0.1 * MM), DISK)["cmod_fracture_energy_complete"] is True


def test_what_stops_early_or_is_too_weak_says_so():
    early = LoadCurve(np.arange(3.0), np.array([0, 0.1, 0.5]) * MM, np.array([0, 3000.0, 500]))
    assert cmod_energy(early, DISK)["cmod_fracture_energy_complete"] is False
    weak = LoadCurve(np.arange(3.0), np.array([0, 0.1, 1.6]) * MM, np.array([0, 30.0, 0]))
    found = cmod_energy(weak, DISK)
    assert found["cmod_fracture_energy_j_per_m2"] == pytest.approx(0.024 / 4.125e-3, rel=1e-12)  # a quotient
    assert found["cmod_fracture_energy_complete"] is False
