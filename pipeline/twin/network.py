"""An irregular central-force network: Delaunay bonds with Voronoi facets, balanced under uniform strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import lsqr

from pipeline.core.errors import InputError
from pipeline.core.specimen import Specimen
from pipeline.twin.points import irregular_points, triangles

SMALLEST_FACET = 0.05  # of the bond length; shorter facets carry next to nothing, and none has a negative one
BALANCE = 0.3  # how dearly a change of a bond's stiffness is paid in the balance of a point


@dataclass(frozen=True)
class IrregularNetwork:
    """Points, bonds and what geometry says about their stiffness and strength.

    Parameters
    ----------
    position : (n, 2) array, m
    pairs : (m, 2) int32 array, first < second
    facet : (m,) array, m; length of the Voronoi facet a bond crosses
    stiffness : (m,) array; K^n over that of the hexagonal lattice of the same material, before calibration
    pitch : float, m
    """

    position: np.ndarray
    pairs: np.ndarray
    facet: np.ndarray
    stiffness: np.ndarray
    pitch: float


def irregular_network(specimen: Specimen, pitch: float, rng: np.random.Generator) -> IrregularNetwork:
    """An irregular network that fills a specimen and leaves its notch open.

    Parameters
    ----------
    specimen : Specimen
    pitch : float, m; spacing of the hexagonal lattice with as many points per area
    rng : numpy Generator

    Raises
    ------
    InputError
        if the pitch is not positive or too coarse for the ligament
    """
    if not 0 < pitch < specimen.ligament_length / 6:
        raise InputError(
            f"pitch = {pitch * 1e3:g} mm must be positive and at most a sixth of the ligament of "
            f"{specimen.ligament_length * 1e3:g} mm"
        )
    position, boundary = irregular_points(specimen, pitch, rng)
    pairs, share = facet_shares(position, triangles(specimen, position, pitch))
    inside = np.arange(len(position)) >= boundary
    stiffness = np.sqrt(3) * share * (1 + balance(position, pairs, share, inside))
    length = np.hypot(*(position[pairs[:, 1]] - position[pairs[:, 0]]).T)
    return IrregularNetwork(position, pairs, share * length, stiffness, pitch)


def facet_shares(position: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bonds (m, 2) of triangles (t, 3), and facet over bond length (m,): ½(cot α + cot β) of the opposite angles.

    This is the Voronoi facet between the two points, cut off at the boundary (1/√3 in a hexagonal lattice).
    """
    ends, half = [], []
    for k in range(3):
        apex, one, two = (corners[:, (k + j) % 3] for j in range(3))
        a, b = position[one] - position[apex], position[two] - position[apex]
        half.append(0.5 * np.sum(a * b, axis=1) / np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
        ends.append(np.sort(np.column_stack([one, two]), axis=1))
    pairs, bond = np.unique(np.vstack(ends), axis=0, return_inverse=True)
    share = np.bincount(bond.ravel(), np.concatenate(half), len(pairs))
    return pairs.astype(np.int32), np.maximum(share, SMALLEST_FACET)


def balance(position: np.ndarray, pairs: np.ndarray, share: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Relative changes of stiffness (m,) under which uniform strain leaves inner points nearly in balance.

    Under uniform strain ε a point feels Σ K L n (n·ε·n), which vanishes for every ε if Σ K L n⊗n⊗n does. A
    network that is out of balance relaxes, which lowers E and drives ν off the value that central forces
    have in balance (1/3 in the plane). The four components are made small in the least-squares sense.

    Parameters
    ----------
    position : (n, 2) array, m
    pairs : (m, 2) int array
    share : (m,) array; stiffness to start from
    inside : (n,) bool array; points that are to be balanced
    """
    vector = position[pairs[:, 1]] - position[pairs[:, 0]]
    length = np.hypot(*vector.T)
    c, s = (vector / length[:, None]).T
    moments = np.stack([c**3, np.sqrt(3) * c * c * s, np.sqrt(3) * c * s * s, s**3], axis=1)
    moments *= (share * length / length.mean())[:, None]
    row = 4 * pairs[:, :, None] + np.arange(4)
    value = np.stack([moments, -moments], axis=1)
    column = np.broadcast_to(np.arange(len(pairs))[:, None, None], row.shape)
    force = sparse.coo_array((value.ravel(), (row.ravel(), column.ravel())), shape=(4 * len(position), len(pairs)))
    force = force.tocsr()[np.repeat(inside, 4)]
    mean = sparse.csr_array(np.full((1, len(pairs)), 1.0))  # on average nothing changes
    system = sparse.vstack([force, BALANCE * sparse.eye_array(len(pairs)), mean]).tocsr()
    wanted = np.concatenate([-force @ np.ones(len(pairs)), np.zeros(len(pairs) + 1)])
    change = lsqr(system, wanted, atol=1e-8, btol=1e-8, iter_lim=400)[0]
    return np.maximum(change, -0.9)
