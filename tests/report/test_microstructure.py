"""Phases and damage: the shown numbers by hand."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from pipeline.core.particles import Phase
from pipeline.report.microstructure import bond_damage, phases, softening
from pipeline.report.style import PHASE_COLOURS, png

from .scene import BEAM, R, lattice, problem


def test_softening_by_hand():
    one = problem()
    reached = np.zeros(one.bonds.count)
    reached[3:8] = [1e-6, 50.5e-6, 1e-4, 5e-4, 0.5e-6]  # peak, half way, broken, far beyond, below the peak
    reached[:3] = 1.0  # bonds that take no damage
    np.testing.assert_allclose(softening(one.law, reached)[:8], [0, 0, 0, 0, 0.5, 1, 1, 0], atol=1e-12)


def test_only_softened_bonds_are_drawn_along_their_faces():
    one = problem()
    reached = np.zeros(one.bonds.count)
    reached[[10, 40]] = [2e-5, 1e-4]
    axes = Figure().subplots()
    bond_damage(axes, one, reached)
    lines = next(c for c in axes.collections if isinstance(c, LineCollection))
    np.testing.assert_allclose(lines.get_array(), softening(one.law, reached)[[10, 40]])
    _, direction = one.bonds.reference(one.particles.position)
    for segment, bond in zip(lines.get_segments(), (10, 40), strict=True):
        middle = one.particles.position[one.bonds.pairs[bond]].mean(axis=0) * 1e3
        along = segment[1] - segment[0]
        np.testing.assert_allclose(segment.mean(axis=0), middle, atol=1e-12)
        assert along @ direction[bond] == pytest.approx(0, abs=1e-12)
        assert np.hypot(*along) == pytest.approx(2 * R * 1e3 / np.sqrt(3))  # edge of a hexagonal cell


def test_the_deformed_specimen_is_drawn_where_it_went():
    one = problem()
    moved = np.full((one.particles.count, 2), 1e-4)
    axes = Figure().subplots()
    bond_damage(axes, one, np.zeros(one.bonds.count), moved, magnification=20, window=(-0.01, 0, 0.01, 0.02))
    np.testing.assert_allclose(axes.collections[0].get_offsets(), (one.particles.position + 2e-3) * 1e3)
    assert axes.get_xlim() == (-10, 10)


def test_phases_have_their_colours_and_shares():
    particles, _ = lattice()
    axes = Figure().subplots()
    phases(axes, BEAM, particles)
    colours = axes.collections[0].get_facecolors()
    for phase in (Phase.MASTIC, Phase.AGGREGATE):
        assert np.all(colours[particles.phase == phase] == to_rgba(PHASE_COLOURS[phase]))
    share = np.mean(particles.phase == Phase.AGGREGATE)
    assert next(t.get_text() for t in axes.get_legend().get_texts()) == f"aggregate ({share:.0%})"


def test_both_can_be_rendered():
    one = problem()
    reached = np.linspace(0, 2e-4, one.bonds.count)
    assert png(lambda a: phases(a, BEAM, one.particles), lambda a: bond_damage(a, one, reached), columns=2)
