"""Hexagonal packing: closed forms of the lattice, and what must hold for every specimen, radius and angle."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.core.errors import InputError
from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam
from pipeline.materials.elastic import Plane, central_force_stiffness
from pipeline.microstructure.packing import Lattice, hexagonal_packing

MM = 1e-3
ANGLES = [90.0, 0.0, 30.0, 60.0, 17.3, -41.0]


@st.composite
def specimens(draw):
    width = draw(st.sampled_from([0.0, 0.4, 1.5, 3.0])) * MM
    if draw(st.booleans()):
        depth = draw(st.floats(50, 80)) * MM
        notch = draw(st.floats(0.1, 0.6)) * depth
        return SingleEdgeNotchedBeam(depth, 2 * depth, 2.2 * depth, 40 * MM, notch, width)
    notch = draw(st.floats(10, 60)) * MM
    return DiskCompactTension(150 * MM, 110 * MM, 35 * MM, 50 * MM, notch, width)


def notch_is_between(specimen, a, b):
    """Whether segments a → b meet the notch line from (0, −∞) to the tip, by the signs of two determinants."""
    sides = (a[:, 0] >= 0) != (b[:, 0] >= 0)
    tip = np.array(specimen.tip)
    area = (b[:, 0] - a[:, 0]) * (tip[1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (tip[0] - a[:, 0])
    return sides & (np.where(b[:, 0] >= a[:, 0], area, -area) > 0)


@settings(max_examples=12)
@given(specimen=specimens(), radius=st.floats(0.9, 1.6), angle=st.floats(-360, 360))
def test_bonds_are_all_neighbours_but_those_across_notch_and_holes(specimen, radius, angle):
    packing = hexagonal_packing(specimen, radius * MM, np.deg2rad(angle))
    position, pairs = packing.position, packing.pairs
    assert specimen.contains(position).all()
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert np.array_equal(np.unique(pairs, axis=0), pairs)  # no pair twice, in order
    found = cKDTree(position).query_pairs(2.01 * radius * MM, output_type="ndarray")
    a, b = position[found[:, 0]], position[found[:, 1]]
    cut = notch_is_between(specimen, a, b)
    fine = np.linspace(0, 1, 49)[:, None, None]  # 48 steps along a bond against eight in the packing
    leaves = [~specimen.contains(row) for row in a + fine * (b - a)]
    surely_left, left = np.any(leaves[6::6], axis=0), np.any(leaves, axis=0)
    number = {tuple(p) for p in pairs.tolist()}
    must = {tuple(sorted(p)) for p in found[~cut & ~left].tolist()}
    may = {tuple(sorted(p)) for p in found[~cut & ~surely_left].tolist()}
    assert must <= number <= may | must
    length = np.hypot(*(position[pairs[:, 1]] - position[pairs[:, 0]]).T)
    assert length == pytest.approx(2 * radius * MM, rel=1e-12)  # round-off of coordinates of 0.15 m against 1.4 mm


@settings(max_examples=20)
@given(specimen=specimens(), radius=st.floats(0.7, 1.2), angle=st.floats(0, 60))
def test_a_packing_hangs_together_and_its_particles_fill_the_specimen(specimen, radius, angle):
    packing = hexagonal_packing(specimen, radius * MM, np.deg2rad(angle))
    count = len(packing.position)
    graph = coo_array((np.ones(len(packing.pairs)), packing.pairs.T), shape=(count, count))
    parts = np.bincount(connected_components(graph, directed=False)[1])
    assert parts.max() >= count - 2  # a sharp corner may hold one centre alone
    x0, y0, x1, y1 = specimen.bounds
    grid = np.stack(np.meshgrid(np.linspace(x0, x1, 900), np.linspace(y0, y1, 900)), -1).reshape(-1, 2)
    area = specimen.contains(grid).mean() * (x1 - x0) * (y1 - y0)
    outline = 2 * (x1 - x0 + y1 - y0) + 2 * specimen.notch_length + 2 * np.pi * 25 * MM
    # a lattice miscounts an area by at most a strip along its outline; half a spacing is a generous one
    assert count * 2 * 3**0.5 * packing.radius**2 == pytest.approx(area, abs=outline * packing.radius)


def test_density_and_bonds_a_particle_converge(beam):
    area = 0.06 * 0.137
    radii = np.array([2.0, 1.0, 0.5, 0.25]) * MM
    packings = [hexagonal_packing(beam, r, np.deg2rad(17.3)) for r in radii]
    density = np.array([len(p.position) * 2 * 3**0.5 * p.radius**2 / area - 1 for p in packings])
    missing = np.array([3 - len(p.pairs) / len(p.position) for p in packings])
    assert (
        np.abs(density) < 0.5 * radii / MM / 60
    ).all()  # error ∝ outline × r/area, here 94/m × r, measured below half
    # the rim lacks bonds: their share falls in proportion to r; fitted slope within 5 % of 1
    assert np.polyfit(np.log(radii), np.log(missing), 1)[0] == pytest.approx(1, abs=0.05)


def test_columns_stand_on_both_sides_of_the_notch_line(beam):
    r = 0.5 * MM
    x, y = hexagonal_packing(beam, r, np.pi / 2).position.T
    column = x / (3**0.5 / 2 * r)
    place = (y - r / 2) / r
    assert column == pytest.approx(2 * np.rint((column - 1) / 2) + 1, abs=1e-9)  # odd multiples; round-off
    assert place == pytest.approx(np.rint(place), abs=1e-9)  # round-off
    assert y.min() == pytest.approx(r / 2, rel=1e-9)  # half a row above the edge
    assert {round(c) for c in column} == {-c for c in {round(c) for c in column}}


def test_rows_keep_off_the_notch_line(beam):
    r = 0.5 * MM
    x, y = hexagonal_packing(beam, r, 0.0).position.T
    row = (y / (3**0.5 / 2 * r) - 1) / 2
    assert row == pytest.approx(np.rint(row), abs=1e-9)  # round-off
    assert np.abs(x).min() == pytest.approx(r / 2, rel=1e-9)
    half = (x - r / 2) / r
    assert half == pytest.approx(np.rint(half), abs=1e-9)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_lattice_is_point_symmetric_about_the_mouth_and_repeats_every_60_degrees(angle):
    box = (-8 * MM, -8 * MM, 8 * MM, 8 * MM)
    points = Lattice(0.4 * MM, np.deg2rad(angle)).points(box).reshape(-1, 2)
    near = points[np.abs(points).max(axis=1) < 7 * MM]
    assert cKDTree(points).query(-near)[0].max() < 1e-15  # m; round-off
    other = Lattice(0.4 * MM, np.deg2rad(angle + 60)).points(box).reshape(-1, 2)
    assert cKDTree(other).query(near)[0].max() < 1e-14  # m; 60° turn in floating point
    row = near[:, 0] * -np.sin(np.deg2rad(angle)) + near[:, 1] * np.cos(np.deg2rad(angle))
    steps = np.diff(np.unique(np.round(row / (3**0.5 * 0.4 * MM), 9)))
    assert steps == pytest.approx(1, abs=1e-6)  # rows √3 r apart run along the angle


@pytest.mark.parametrize("angle", [30.0 + 60 * k for k in range(-6, 6)])
@pytest.mark.parametrize("error", [-2e-14, 0.0, 2e-14])
def test_round_off_in_an_angle_does_not_move_the_lattice(angle, error):
    """30° + 60° k is where the bond whose middle is the origin changes."""
    exact, near = (Lattice(0.4 * MM, np.deg2rad(a)) for a in (90.0, angle * (1 + error)))
    assert near.origin == pytest.approx(exact.origin, abs=1e-15)  # m; round-off


def test_particles_lie_line_by_line(beam):
    packing = hexagonal_packing(beam, 0.5 * MM, np.pi / 2)
    assert np.array_equal(
        np.lexsort((packing.position[:, 1], np.round(packing.position[:, 0], 9))), np.arange(len(packing.position))
    )
    for angle in ANGLES:
        turned = hexagonal_packing(beam, 0.5 * MM, np.deg2rad(angle))
        assert np.diff(turned.pairs).max() < 1.25 * 60 / 0.866 + 2  # at most one line of the short side away


@pytest.mark.parametrize("angle", ANGLES)
def test_patch_between_moved_rims_strains_uniformly_with_the_modulus_and_ratio(beam, angle):
    """Rim held at an affine displacement, inside in equilibrium: inside is affine, and σ is the continuum's."""
    packing = hexagonal_packing(beam, 1.0 * MM, np.deg2rad(angle))
    k_n = central_force_stiffness(1e10, 0.25, Plane.STRAIN, beam.thickness)
    centre = np.hypot(*(packing.position - (0.03, 0.03)).T)
    patch = centre < 20 * MM
    pairs = packing.pairs[patch[packing.pairs].all(axis=1)]
    arm = packing.position[pairs[:, 1]] - packing.position[pairs[:, 0]]
    normal = arm / np.hypot(*arm.T)[:, None]
    free_strain = np.diag([1e-4, -1e-4 / 3])  # uniaxial stress in plane strain at ν = 1/4: ε_yy = −ν/(1 − ν) ε_xx
    affine = packing.position @ free_strain
    row = np.repeat(np.arange(len(pairs)), 4)
    column = np.column_stack([2 * pairs[:, :1], 2 * pairs[:, :1] + 1, 2 * pairs[:, 1:], 2 * pairs[:, 1:] + 1]).ravel()
    stretch = coo_array((np.column_stack([-normal, normal]).ravel(), (row, column)), shape=(len(pairs), affine.size))
    stiffness = k_n * (stretch.T @ stretch).toarray()
    inside = np.repeat(centre < 16 * MM, 2)
    rim = np.repeat(patch, 2) & ~inside
    moved = np.linalg.solve(stiffness[np.ix_(inside, inside)], -stiffness[np.ix_(inside, rim)] @ affine.ravel()[rim])
    assert moved == pytest.approx(affine.ravel()[inside], abs=1e-12 * 1e-4)  # round-off of displacements of 3 µm
    core = centre < 12 * MM
    force = k_n * np.sum((affine[pairs[:, 1]] - affine[pairs[:, 0]]) * normal, axis=1)
    share = core[pairs].sum(axis=1) / 2  # a bond belongs half to each of its particles
    stress = (share * force * normal.T) @ arm / (core.sum() * 2 * 3**0.5 * (1 * MM) ** 2 * beam.thickness)
    assert stress[0, 0] == pytest.approx(1e-4 * 1e10 / (1 - 0.25**2), rel=1e-11)  # E/(1 − ν²); round-off
    assert np.abs([stress[1, 1], stress[0, 1]]).max() < 1e-11 * stress[0, 0]  # round-off


@pytest.mark.parametrize("angle", ANGLES)
def test_rigid_motion_stretches_no_bond(disk, angle):
    packing = hexagonal_packing(disk, 2 * MM, np.deg2rad(angle))
    motion = np.array([3e-3, -1e-3]) + 0.01 * np.column_stack([-packing.position[:, 1], packing.position[:, 0]])
    arm = packing.position[packing.pairs[:, 1]] - packing.position[packing.pairs[:, 0]]
    stretch = np.sum((motion[packing.pairs[:, 1]] - motion[packing.pairs[:, 0]]) * arm, axis=1)
    assert np.abs(stretch).max() < 1e-16 * 4 * MM  # 1e-16 m of a millimetre's motion: round-off


@pytest.mark.parametrize(
    ("radius", "word"),
    [(0.0, "must be positive"), (-3e-4, "must be positive"), (5e-3, "too large"), (3e-7, "check the unit")],
)
def test_radii_without_sense_are_refused(beam, radius, word):
    with pytest.raises(InputError, match=word):
        hexagonal_packing(beam, radius)


def test_the_papers_beam_is_packed_in_a_moment(beam):
    start = time.process_time()
    packing = hexagonal_packing(beam, 0.3 * MM)
    assert len(packing.position) == pytest.approx(0.06 * 0.137 / (2 * 3**0.5 * (0.3 * MM) ** 2), rel=0.005)  # rim
    assert time.process_time() - start < 2  # s; measured 0.1
