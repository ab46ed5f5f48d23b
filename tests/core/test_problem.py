"""Grips, gauge and energies: sums that can be redone on paper."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.particles import Bonds, Particles
from pipeline.core.problem import EnergyBalance, Gauge, Grip, Role


def test_a_grip_takes_the_weighted_mean_along_its_direction():
    grip = Grip("platen", np.array([0, 2]), np.array([0.25, 0.75]), np.array([0.0, -1.0]), 1.0, Role.DRIVE)
    assert grip.mean(np.array([[9.0, 1.0], [9.0, 9.0], [9.0, 3.0]])) == -(0.25 * 1 + 0.75 * 3)


def test_a_gauge_feels_opening_and_neither_translation_nor_vertical_motion():
    gauge = Gauge(np.array([0, 1, 2]), np.array([-0.5, -0.5, 1.0]))
    assert gauge.cmod(np.full((3, 2), 7.0)) == 0
    assert gauge.cmod(np.array([[-1.0, 5.0], [-3.0, 6.0], [1.0, 7.0]])) == 3.0


def test_an_energy_balance_is_off_by_what_is_missing():
    assert EnergyBalance(10.0, 4.0, 5.0, 0.5, 0.25).error == pytest.approx(0.025, rel=1e-14)
    assert EnergyBalance(10.0, 4.0, 6.0).error == 0
    assert np.isnan(EnergyBalance(0.0, 0.0, 0.0).error)


def test_reference_lengths_and_directions():
    particles = Particles(
        np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 0.0]]), 1.0, np.ones(3, np.uint8), np.zeros(3, np.int32)
    )
    bonds = Bonds(np.array([[0, 1], [1, 2]], np.int32), np.ones(2, np.uint8), np.zeros(2, bool))
    length, direction = bonds.reference(particles.position)
    np.testing.assert_allclose(length, [5, 4])
    np.testing.assert_allclose(direction, [[0.6, 0.8], [0, -1]])
    assert (particles.count, bonds.count) == (3, 2)
