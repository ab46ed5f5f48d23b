"""The rules that show wrong units: what they compute, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.specimen import DiskCompactTension
from pipeline.core.units import MM
from pipeline.store.plausibility import clock_problems, motion_problems, nominal_stress, view_problems
from pipeline.store.sections import PixelFrame


def test_nominal_stress_of_the_beam(beam):
    """M = P S/4, σ = 6 M/(t b²): 3 kN on the paper's beam."""
    moment = 3000 * 0.13 / 4
    assert 3000 * nominal_stress(beam) == pytest.approx(6 * moment / (0.04 * 0.045**2), rel=1e-12)  # rounding


def test_nominal_stress_of_the_disk():
    """Tension P/(t b) and bending by the arm a + b/2; equals 2 P (2W + a)/(t (W − a)²) (ASTM E399)."""
    disk = DiskCompactTension(0.15, 0.11, 0.035, 0.05, 0.0275)
    w, a = 0.11, 0.0275
    assert nominal_stress(disk) == pytest.approx(2 * (2 * w + a) / (0.05 * (w - a) ** 2), rel=1e-12)  # rounding


def test_two_frames_within_the_record_are_enough(curve):
    assert clock_problems("x", np.array([-50.0, 10.0, 20.0]), curve) == []
    assert len(clock_problems("x", np.array([-50.0, -20.0, 20.0]), curve)) == 1


def test_early_frames_say_nothing_about_units():
    points = np.random.default_rng(0).uniform(0, 0.05, (20, 2))
    assert motion_problems("x", points, 1e-7 * points, 1e-6, 2e-7) == []
    assert len(motion_problems("x", points, 1e-7 * points**2, 1e-4, 2e-7)) == 1


@pytest.mark.parametrize("turn", [0.0, 90.0, 180.0, -90.0])
@pytest.mark.parametrize("mirror", [False, True])
def test_a_turned_or_mirrored_photograph_of_the_specimen_is_accepted(beam, turn, mirror):
    """The same 137 × 60 mm face at 0.5 mm/px, its origin at the mouth, from every side."""
    upright = abs(turn) == 90
    shape = (274, 120) if upright else (120, 274)
    origin = {0.0: (137, 120), 180.0: (137, 0), 90.0: (0, 137), -90.0: (120, 137)}[turn]
    frame = PixelFrame(mm_per_px=0.5, origin_px=origin, rotation_deg=turn, mirror=mirror)
    covered = frame.placement().to_specimen(np.array([(0, 0), shape[::-1]], float))
    assert np.allclose(
        np.sort(covered, axis=0), [[-68.5 * MM, 0], [68.5 * MM, 60 * MM]], rtol=0, atol=1e-12
    )  # round-off
    assert view_problems("x", "camera", frame, shape, beam) == []
