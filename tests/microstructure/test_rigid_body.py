"""The rigid part of a packing: cases made by hand, and the rank of the rigidity matrix."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pipeline.microstructure.rigid_body import main_part, rigid_part

BLOCK = [(i, j) for i in range(4) for j in range(3)]
POINTED = [(i, j) for i in range(4) for j in range(4) if i + j <= 3]  # a triangle with a tip at (3, 0)


def lattice(places):
    """Particles of spacing 1 at places (i, j) of the lattice (1, 0), (1/2, √3/2), and the bonds of neighbours."""
    position = np.array(places, float) @ np.array([[1.0, 0.0], [0.5, 3**0.5 / 2]])
    return position, cKDTree(position).query_pairs(1.01, output_type="ndarray")


def rigidity_rank(position, pairs):
    arm = position[pairs[:, 1]] - position[pairs[:, 0]]
    matrix = np.zeros((len(pairs), len(position), 2))
    matrix[np.arange(len(pairs)), pairs[:, 0]] = -arm
    matrix[np.arange(len(pairs)), pairs[:, 1]] = arm
    return np.linalg.matrix_rank(matrix.reshape(len(pairs), -1), tol=1e-9)


@pytest.mark.parametrize(
    ("places", "loose"),
    [
        (BLOCK, 0),
        ([*BLOCK, (4, 1)], 0),  # bonds in two directions
        ([*BLOCK, (4, 2)], 1),  # one bond
        ([*BLOCK, (4, 2), (5, 2)], 2),  # a chain of two
        ([*BLOCK, (4, -1), (5, -1), (5, -2)], 3),  # a triangle on one bond
        ([*POINTED, (4, 0), (4, -1)], 2),  # a triangle that shares one particle: a hinge
        ([*POINTED, (4, 0), (4, -1), (3, 1)], 0),  # ... with a stay
    ],
)
def test_what_hangs_on_a_body(places, loose):
    assert (~rigid_part(*lattice(places))).sum() == loose


def test_a_particle_on_two_bonds_in_one_line_is_loose():
    gone = {(4, 5), (4, 3), (5, 3), (3, 5)}  # all neighbours of (4, 4) but the two along its row
    places = [(i, j) for i in range(9) for j in range(9) if (i, j) not in gone]
    kept = rigid_part(*lattice(places))
    assert [p for p, k in zip(places, kept, strict=True) if not k] == [(4, 4)]


@pytest.mark.parametrize(
    ("links", "loose"),
    [
        ({((0, 1), (0, 2)), ((3, 1), (2, 2)), ((6, 1), (6, 2))}, 0),  # three bonds, not parallel, not through one point
        ({((0, 1), (0, 2)), ((3, 1), (3, 2)), ((6, 1), (6, 2))}, 14),  # three parallel ones: the halves shear
        ({((0, 1), (0, 2)), ((3, 1), (2, 2))}, 14),  # two
    ],
)
def test_two_halves_joined_by_single_bonds(links, loose):
    places = [(i, j) for i in range(7) for j in range(4)]
    position, pairs = lattice(places)
    row = np.array(places)[:, 1][pairs]
    between = np.sort(row, axis=1).tolist()
    kept = [
        k
        for k, p in enumerate(pairs)
        if between[k] != [1, 2] or tuple(sorted(places[n] for n in p)) in {tuple(sorted(link)) for link in links}
    ]
    assert (~rigid_part(position, pairs[kept])).sum() == loose


def test_the_main_part_is_the_largest_connected_one():
    position, pairs = lattice([*BLOCK, (8, 8), (8, 9), (9, 8)])
    assert np.flatnonzero(~main_part(len(position), pairs)).tolist() == [12, 13, 14]


def test_nothing_is_rigid_without_a_triangle():
    assert not rigid_part(*lattice([(0, 0), (1, 0), (2, 0)])).any()


@settings(max_examples=40)
@given(missing=st.sets(st.tuples(st.integers(0, 8), st.integers(0, 7)), max_size=45))
def test_the_part_found_is_rigid(missing):
    position, pairs = lattice([(i, j) for i in range(9) for j in range(8) if (i, j) not in missing])
    kept = rigid_part(position, pairs)
    if kept.any():
        number = np.cumsum(kept) - 1
        rank = rigidity_rank(position[kept], number[pairs[kept[pairs].all(axis=1)]])
        assert rank == 2 * kept.sum() - 3  # all but the three rigid motions of the plane
