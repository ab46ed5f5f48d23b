"""Which flank a point lies on: two rigid halves that part, with points moved to the other one on purpose."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.inverse.flanks import changed_flank

COLUMNS, ROWS = (-9e-3, -4.5e-3, 4.5e-3, 9e-3), (15e-3, 16.5e-3, 18e-3, 20e-3)
POINTS = np.array([(x, y) for y in ROWS for x in COLUMNS])
OPENINGS = np.array([0.05e-3, 0.2e-3, 0.5e-3])  # at the mouth
HINGE = 55e-3
NOISE = 0.4e-6


def parted(sides=None, rotation=0.0, shift=0.0):
    """Displacements (s, p, 2) of halves that turn about a hinge, of points on the flanks `sides` (−1, 1)."""
    sides = np.sign(POINTS[:, 0]) if sides is None else sides
    opening = OPENINGS[:, None] * (1 - POINTS[:, 1] / HINGE)
    across = sides * opening / 2 + shift - rotation * POINTS[:, 1]
    return np.stack([across, np.zeros_like(across)], axis=-1)


def flanks(measured, *simulated):
    return changed_flank(POINTS, measured, np.full(measured.shape[:2], NOISE), np.stack(simulated))


@given(st.floats(-5e-3, 5e-3), st.floats(-1e-3, 1e-3), st.integers(0, 2**32 - 1), st.floats(0.8, 1.2))
def test_rigid_motion_noise_and_other_openings_change_no_flank(rotation, shift, seed, factor):
    noise = np.random.default_rng(seed).normal(0, NOISE, (len(OPENINGS), len(POINTS), 2))
    assert not flanks(parted(rotation=rotation, shift=shift) + noise, factor * parted()).any()


@pytest.mark.parametrize("moved", [[13], [13, 1], [12, 13], [2]])
def test_points_on_the_other_flank_are_found_whichever_side_says_so(moved):
    sides = np.sign(POINTS[:, 0])
    sides[moved] *= -1
    wanted = np.zeros((len(OPENINGS), len(POINTS)), bool)
    wanted[:, moved] = True
    assert np.array_equal(flanks(parted(sides), parted()), wanted)
    assert np.array_equal(flanks(parted(), parted(), parted(sides)), wanted)  # one simulation of two is enough
    assert not flanks(parted(sides), parted(sides)).any()


def test_missing_vectors_are_no_other_flank():
    measured = parted()
    measured[1, 3] = np.nan
    measured[2] = np.nan
    simulated = parted()
    simulated[:, 5] = np.nan
    assert not flanks(measured, simulated).any()


def test_openings_within_the_noise_part_nothing():
    quiet = 1e-3 * parted()
    sides = np.sign(POINTS[:, 0])
    sides[13] *= -1
    assert not flanks(quiet, 1e-3 * parted(sides)).any()
