"""Grips and gauge: exact lines of action, exact readings of rigid and uniform motion."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.core.particles import Particles
from pipeline.core.problem import Role
from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam
from pipeline.microstructure.attachment import attach_gauge, attach_grips, gauge_remark
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phases import lay_phases

MM = 1e-3
SPECIMENS = [
    SingleEdgeNotchedBeam(0.06, 0.13, 0.137, 0.04, 0.015),
    SingleEdgeNotchedBeam(0.06, 0.13, 0.137, 0.04, 0.015, notch_width=3 * MM, gauge_y=-3 * MM),
    DiskCompactTension(0.15, 0.11, 0.035, 0.05, 0.0275, notch_width=1.5 * MM),
]


def particles_of(specimen, radius=0.6 * MM, angle=0.3, gone=None):
    """All-mastic particles, without those for which `gone(x, y)` (mm) holds."""
    particles, _, _ = lay_phases(specimen, hexagonal_packing(specimen, radius, angle))
    stay = np.ones(particles.count, bool) if gone is None else ~gone(*particles.position.T / MM)
    return Particles(particles.position[stay], radius, particles.phase[stay], particles.stone[stay])


@settings(max_examples=25)
@given(specimen=st.sampled_from(SPECIMENS), radius=st.floats(0.5, 1.0), angle=st.floats(0, 60))
def test_grip_forces_act_on_their_line(specimen, radius, angle):
    particles = particles_of(specimen, radius * MM, np.deg2rad(angle))
    for grip, region in zip(attach_grips(specimen, particles), specimen.grip_regions(radius * MM), strict=True):
        x = particles.position[grip.index, 0]
        assert grip.weight.sum() == pytest.approx(1, abs=1e-13)  # round-off
        assert grip.weight.min() >= 0
        assert (grip.name, grip.role, grip.drive) == (region.name, Role(region.role), region.drive)
        if region.anchor_x is not None:
            assert grip.weight @ x == pytest.approx(region.anchor_x, abs=1e-15)  # m; round-off of 65 mm


def test_the_change_of_the_weights_is_the_smallest_one():
    """Any other change that keeps sum and mean x is longer: the found one is a multiple of x − x̄."""
    specimen = SPECIMENS[0]
    particles = particles_of(specimen)
    platen = attach_grips(specimen, particles)[0]
    x = particles.position[platen.index, 0]
    change, arm = platen.weight - 1 / x.size, x - x.mean()
    assert np.abs(change).max() > 1e-3
    assert change == pytest.approx(arm * (change @ arm) / (arm @ arm), abs=1e-14)  # round-off


def test_rollers_free_a_beam_to_turn_about_them():
    """Mean displacement of a patch turned about its anchor: the arm of the weights, not of the patch's middle."""
    specimen = SPECIMENS[0]
    particles = particles_of(specimen)
    left = next(g for g in attach_grips(specimen, particles) if g.name == "left")
    turned = 1e-3 * np.column_stack([-particles.position[:, 1], particles.position[:, 0] + 0.065])
    assert left.mean(turned) == pytest.approx(0, abs=1e-17)  # m; round-off of 65 µm


def test_a_void_at_a_roller_deepens_the_patch_and_too_large_a_void_is_refused():
    specimen = SPECIMENS[0]
    small = particles_of(specimen, gone=lambda x, y: np.hypot(x + 65, y) < 1.8)
    left = next(g for g in attach_grips(specimen, small) if g.name == "left")
    reach = np.hypot(*(small.position[left.index] - (-0.065, 0)).T).max()
    assert 2 * MM < reach < 4 * MM
    with pytest.raises(InputError, match=r"grip 'left' at \(-65, 0\) mm touches 0 particles"):
        attach_grips(specimen, particles_of(specimen, gone=lambda x, y: np.hypot(x + 65, y) < 5))
    with pytest.raises(InputError, match=r"too much to one side for its force to act at x = -65 mm"):
        attach_grips(specimen, particles_of(specimen, 0.4 * MM, gone=lambda x, y: (x < -64.9) & (y < 9)))


@pytest.mark.parametrize("specimen", SPECIMENS)
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2])
def test_the_gauge_reads_motions_of_the_flanks_exactly(specimen, angle):
    particles = particles_of(specimen, angle=angle)
    gauge = attach_gauge(specimen, particles)
    x, y = particles.position.T
    still = np.zeros(x.size)
    right = (x >= 0) & (y < specimen.tip[1])
    assert gauge.cmod(np.column_stack([np.where(right, 1e-4, 0), still])) == pytest.approx(1e-4, abs=1e-17)
    assert gauge.cmod(np.column_stack([still + 5e-3, still - 2e-3])) == pytest.approx(0, abs=1e-16)  # translation
    assert gauge.cmod(0.01 * np.column_stack([-y, x])) == pytest.approx(0, abs=1e-16)  # rotation of the whole
    hinge = (
        np.where(x >= 0, 1, -1)[:, None] * 1e-3 * np.column_stack([specimen.tip[1] - y, x])
    )  # halves turn about the tip
    assert gauge.cmod(hinge) == pytest.approx(2e-3 * (specimen.tip[1] - specimen.gauge_y), rel=1e-12)
    assert gauge.cmod(np.column_stack([1e-4 * x, still])) == pytest.approx(1e-4 * specimen.gauge_length, rel=1e-12)


@pytest.mark.parametrize("specimen", SPECIMENS)
def test_each_end_of_the_gauge_stays_on_its_flank(specimen):
    particles = particles_of(specimen)
    gauge = attach_gauge(specimen, particles)
    x, y = particles.position[gauge.index].T
    assert (y < specimen.tip[1]).all()
    assert gauge.weight[x >= 0].sum() == pytest.approx(1, abs=1e-12)  # round-off
    assert gauge.weight[x < 0].sum() == pytest.approx(-1, abs=1e-12)
    assert np.hypot(np.abs(x) - specimen.gauge_length / 2, y - specimen.gauge_y).max() < 5 * 1.2 * MM - specimen.gauge_y
    assert gauge_remark(specimen, particles) is None


def test_a_short_notch_keeps_the_gauge_below_its_tip():
    specimen = replace(SPECIMENS[0], notch_length=3 * MM)
    particles = particles_of(specimen)
    assert particles.position[attach_gauge(specimen, particles).index, 1].max() < 3 * MM


def test_a_void_at_the_mouth_moves_the_gauge_inwards_and_is_said():
    specimen = SPECIMENS[0]
    particles = particles_of(specimen, gone=lambda x, y: np.hypot(x - 2, y) < 5)
    gauge = attach_gauge(specimen, particles)
    assert gauge.cmod(np.where(particles.position[:, :1] >= 0, [[1e-4, 0]], 0.0)) == pytest.approx(1e-4, rel=1e-12)
    assert gauge_remark(specimen, particles).startswith("the right gauge point at (2, 0) mm lies in a void")


def test_a_flank_without_particles_is_refused():
    with pytest.raises(InputError, match="no particles below the tip"):
        attach_gauge(SPECIMENS[0], particles_of(SPECIMENS[0], gone=lambda x, y: (x < 0) & (y < 15)))
