"""Linear elasticity by six-node triangles, written apart from the package: what an elastic specimen must do.

Zienkiewicz & Taylor (2000), vol. 1: area coordinates, three-point quadrature at the middles of the edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

from pipeline.core.particles import Particles, Phase
from pipeline.core.problem import Gauge, Grip, Role
from pipeline.core.specimen import Specimen

INSIDE = 1e-9  # m; by how much points of the boundary may lie outside through round-off


@dataclass(frozen=True)
class Mesh:
    """Nodes (n, 2), m, and triangles (e, 6): corners, then the middles of edges 01, 12, 20."""

    nodes: np.ndarray
    triangles: np.ndarray

    def as_particles(self, pitch: float) -> Particles:
        """The nodes as what grips and gauges are attached to."""
        n = len(self.nodes)
        return Particles(self.nodes, pitch / 2, np.full(n, Phase.MASTIC, np.uint8), np.zeros(n, np.int32))


def mesh_of(specimen: Specimen, pitch: float, notched: bool = True) -> Mesh:
    """Triangles of a specimen with a straight cut of no width at x = 0, edges about `pitch` (m) long."""
    rims = [_walk(line, pitch) for line in specimen.outline()[:-1]]
    corners = np.vstack([_lattice(specimen, pitch, np.vstack(rims)), *rims])
    corners = np.unique(np.round(corners, 9), axis=0)
    triangles = Delaunay(corners).simplices
    middle = corners[triangles].mean(axis=1)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    triangles = np.where((area > 0)[:, None], triangles, triangles[:, [0, 2, 1]])
    triangles = triangles[specimen.contains(middle) & (np.abs(area) > 1e-4 * pitch**2)]
    if notched:
        corners, triangles = _slit(corners, triangles, specimen.tip[1])
    return _with_middles(corners, triangles)


def _lattice(specimen: Specimen, pitch: float, rim: np.ndarray) -> np.ndarray:
    """Triangular lattice with a column on x = 0 and a node at the tip, clear of the rim but for that column."""
    x0, _, x1, y1 = specimen.bounds
    rise = specimen.tip[1] / round(specimen.tip[1] / pitch)
    columns = np.arange(int(x0 / (rise * np.sqrt(0.75))) - 1, int(x1 / (rise * np.sqrt(0.75))) + 2)
    column, row = np.meshgrid(columns, np.arange(-1, int(y1 / rise) + 2))
    points = np.column_stack([(column * rise * np.sqrt(0.75)).ravel(), (rise * (row + 0.5 * (column % 2))).ravel()])
    points = points[specimen.contains(points)]
    nearest = np.min([np.hypot(*(points - p).T) for p in rim], axis=0)
    return points[nearest > 0.55 * pitch]


def _walk(line: np.ndarray, pitch: float) -> np.ndarray:
    """Points along a closed polygon, not farther apart than `pitch`, corners and x = 0 among them."""
    parts = []
    for start, end in pairwise(line):
        marks = [0.0, 1.0]
        if start[0] * end[0] < 0:
            marks.insert(1, start[0] / (start[0] - end[0]))
        for low, high in pairwise(marks):
            length = np.hypot(*(end - start)) * (high - low)
            share = low + (high - low) * np.arange(max(round(length / pitch), 1)) / max(round(length / pitch), 1)
            parts.append(start + share[:, None] * (end - start))
    points = np.vstack(parts)
    keep = [0]  # fine polygons of circles: drop what is too near the last one kept
    for k in range(1, len(points)):
        if np.hypot(*(points[k] - points[keep[-1]])) > 0.8 * pitch or abs(points[k][0]) < INSIDE:
            keep.append(k)
    return points[keep]


def _slit(corners: np.ndarray, triangles: np.ndarray, tip: float) -> tuple[np.ndarray, np.ndarray]:
    """Give the triangles on the left of the notch corners of their own, a hair to the left."""
    on = np.flatnonzero((np.abs(corners[:, 0]) < INSIDE) & (corners[:, 1] < tip - INSIDE))
    twin = np.arange(len(corners))
    twin[on] = len(corners) + np.arange(on.size)
    left = corners[triangles].mean(axis=1)[:, 0] < 0
    return np.vstack([corners, corners[on] - (INSIDE, 0)]), np.where(left[:, None], twin[triangles], triangles)


def _with_middles(corners: np.ndarray, triangles: np.ndarray) -> Mesh:
    """Nodes in the middles of the edges; nodes that no triangle has are left out."""
    used, triangles = np.unique(triangles, return_inverse=True)
    corners, triangles = corners[used], triangles.reshape(-1, 3)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    middles = corners[unique].mean(axis=1)
    return Mesh(np.vstack([corners, middles]), np.hstack([triangles, len(corners) + number.reshape(-1, 3)]))


def stiffness(mesh: Mesh, modulus: float, poissons_ratio: float, thickness: float) -> sparse.csc_array:
    """Plane strain stiffness (2n, 2n), N/m."""
    nu = poissons_ratio
    matrix = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]])
    matrix *= modulus / ((1 + nu) * (1 - 2 * nu)) * thickness
    corner = mesh.nodes[mesh.triangles[:, :3]]
    edge = np.roll(corner, -1, axis=1) - np.roll(corner, -2, axis=1)  # opposite to each corner, backwards
    area = 0.5 * (edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    slope = np.stack([edge[:, :, 1], -edge[:, :, 0]], axis=2) / (2 * area)[:, None, None]  # of the area coordinates
    element = np.zeros((len(area), 12, 12))
    for a, b, c in ((0.5, 0.5, 0.0), (0.0, 0.5, 0.5), (0.5, 0.0, 0.5)):
        at = np.array([a, b, c])
        shape = [(4 * at[k] - 1) * slope[:, k] for k in range(3)]
        shape += [4 * (at[k] * slope[:, m] + at[m] * slope[:, k]) for k, m in ((0, 1), (1, 2), (2, 0))]
        strain = np.zeros((len(area), 3, 12))
        for k, d in enumerate(shape):
            strain[:, 0, 2 * k], strain[:, 1, 2 * k + 1] = d[:, 0], d[:, 1]
            strain[:, 2, 2 * k], strain[:, 2, 2 * k + 1] = d[:, 1], d[:, 0]
        element += (np.abs(area) / 3)[:, None, None] * np.einsum("eki,kl,elj->eij", strain, matrix, strain)
    dof = (2 * mesh.triangles[:, :, None] + np.arange(2)).reshape(len(area), 12)
    row, column = np.repeat(dof, 12, axis=1).ravel(), np.tile(dof, (1, 12)).ravel()
    size = 2 * len(mesh.nodes)
    return sparse.coo_array((element.ravel(), (row, column)), shape=(size, size)).tocsc()


def response(matrix: sparse.csc_array, grips: tuple[Grip, ...], gauge: Gauge) -> tuple[float, float]:
    """CMOD over load and machine displacement over load (m/N), by Lagrange multipliers for the grips."""
    size = matrix.shape[0]
    rows = np.zeros((len(grips), size))
    for row, grip in zip(rows, grips, strict=True):
        for k in (0, 1):
            row[2 * grip.index + k] += grip.weight * grip.direction[k]
    scale = matrix.diagonal().mean()
    held = sparse.block_array([[matrix, scale * sparse.csc_array(rows.T)], [scale * sparse.csc_array(rows), None]])
    right = np.concatenate([np.zeros(size), scale * np.array([grip.drive for grip in grips])])
    solved = splu(held.tocsc()).solve(right)
    reaction = -scale * solved[size:]
    load = sum(r for r, grip in zip(reaction, grips, strict=True) if grip.role is Role.DRIVE)
    return gauge.cmod(solved[:size].reshape(-1, 2)) / load, 1 / load
