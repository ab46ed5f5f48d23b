"""Triangles joined by edges: degrees of freedom, stiffness of the bulk, openings of the edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.blind.mesh import Mesh, shares
from pipeline.blind.order import dissected


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh whose triangles share nodes where they are fused and part where they are not.

    Parameters
    ----------
    mesh : Mesh
    node : (t, 3) int array; the node of every corner, several at one point where triangles can part
    nodes : int
    ends : (c, 2, 2) int array; nodes of the cohesive edges: [edge, end, triangle]
    sides : (c, 2) int array; the two triangles of each
    middle : (c, 2) array, m
    frame : (c, 2, 2) array; rows: unit normal from the first to the second triangle, unit tangent
    length : (c,) array, m
    thickness : float, m
    """

    mesh: Mesh
    node: np.ndarray
    nodes: int
    ends: np.ndarray
    sides: np.ndarray
    middle: np.ndarray
    frame: np.ndarray
    length: np.ndarray
    thickness: float

    @property
    def size(self) -> int:
        """Degrees of freedom."""
        return 2 * self.nodes

    @cached_property
    def position(self) -> np.ndarray:
        """(nodes, 2) array, m"""
        place = np.zeros((self.nodes, 2))
        place[self.node.ravel()] = self.mesh.points[self.mesh.corners.ravel()]
        return place

    @cached_property
    def strain(self) -> np.ndarray:
        """(t, 3, 6) array: strain (xx, yy, 2xy) from the six displacements of a triangle, 1/m."""
        p = self.mesh.points[self.mesh.corners]
        x, y = p[:, :, 0], p[:, :, 1]
        b = np.stack([y[:, 1] - y[:, 2], y[:, 2] - y[:, 0], y[:, 0] - y[:, 1]], axis=1)
        c = np.stack([x[:, 2] - x[:, 1], x[:, 0] - x[:, 2], x[:, 1] - x[:, 0]], axis=1)
        found = np.zeros((len(p), 3, 6))
        found[:, 0, 0::2], found[:, 1, 1::2] = b, c
        found[:, 2, 0::2], found[:, 2, 1::2] = c, b
        return found / (2 * self.mesh.area[:, None, None])

    @cached_property
    def own(self) -> np.ndarray:
        """(t, 6) int array; degrees of freedom of every triangle."""
        return np.stack([2 * self.node, 2 * self.node + 1], axis=2).reshape(-1, 6)

    def bulk(self, elasticity: np.ndarray, modulus: np.ndarray) -> csr_matrix:
        """Stiffness of the triangles, N/m, for elasticity (3, 3) at unit modulus and moduli (t,), Pa."""
        weight = modulus * self.mesh.area * self.thickness
        block = np.einsum("tai,ab,tbj,t->tij", self.strain, elasticity, self.strain, weight, optimize=True)
        row, column = np.repeat(self.own, 6, axis=1), np.tile(self.own, (1, 6))
        return coo_matrix((block.ravel(), (row.ravel(), column.ravel())), (self.size, self.size)).tocsr()

    def forces(self, stress: np.ndarray) -> np.ndarray:
        """Nodal forces (size,) of stresses (t, 3), Pa."""
        pull = np.einsum("tai,ta,t->ti", self.strain, stress, self.mesh.area * self.thickness)
        return np.bincount(self.own.ravel(), pull.ravel(), self.size)

    @cached_property
    def opener(self) -> csr_matrix:
        """(4c, size): normal and tangential opening at both ends of every edge."""
        c = len(self.ends)
        node = np.repeat(self.ends.reshape(2 * c, 2), 2, axis=0)  # row: (edge, end, component)
        axis = np.repeat(self.frame[:, None], 2, axis=1).reshape(4 * c, 2)
        row = np.repeat(np.arange(4 * c), 4)
        column = np.stack([2 * node[:, 0], 2 * node[:, 0] + 1, 2 * node[:, 1], 2 * node[:, 1] + 1], axis=1)
        value = np.hstack([-axis, axis])
        return coo_matrix((value.ravel(), (row, column.ravel())), (4 * c, self.size)).tocsr()

    @cached_property
    def weight(self) -> np.ndarray:
        """(2c,) array, m²; area of both ends of every edge."""
        return np.repeat(self.length * self.thickness / 2, 2)

    def opening(self, moved: np.ndarray) -> np.ndarray:
        """Openings (2c, 2), m, at displacements (size,)."""
        return (self.opener @ moved).reshape(-1, 2)

    def row(self, places: np.ndarray, direction: np.ndarray) -> csr_matrix:
        """(n, size): displacement along a direction (2,) at places (n, 2), m, of the triangle that holds each or the
        nearest one."""
        triangle = self.mesh.triangle_at(places)
        lost = triangle < 0
        if lost.any():
            triangle[lost] = np.argmin(
                np.hypot(*(self.mesh.centre[None] - places[lost][:, None]).transpose(2, 0, 1)), axis=1
            )
        return self.row_in(triangle, places, direction)

    def row_in(self, triangle: np.ndarray, places: np.ndarray, direction: np.ndarray) -> csr_matrix:
        """The same for known triangles (n,)."""
        share = shares(self.mesh.points[self.mesh.corners[triangle]], places)
        value = share[:, :, None] * direction
        row = np.repeat(np.arange(len(places)), 6)
        return coo_matrix((value.reshape(-1), (row, self.own[triangle].ravel())), (len(places), self.size)).tocsr()


def sewn(opener: csr_matrix, weight: np.ndarray, tangent: np.ndarray) -> csr_matrix:
    """Stiffness of edges, N/m, from the tangents (q, 2, 2), Pa/m, at their ends of areas (q,), m²."""
    block = tangent * weight[:, None, None]
    first = 2 * np.arange(len(block))
    row = np.stack([first, first, first + 1, first + 1], axis=1)
    column = np.stack([first, first + 1, first, first + 1], axis=1)
    shape = (2 * len(block), 2 * len(block))
    middle = coo_matrix((block.reshape(-1, 4).ravel(), (row.ravel(), column.ravel())), shape).tocsr()
    return (opener.T @ middle @ opener).tocsr()


def join(mesh: Mesh, parts: np.ndarray, cut: np.ndarray, thickness: float) -> Body:
    """A body from a mesh.

    Parameters
    ----------
    mesh : Mesh
    parts : (e,) bool; inner edges that can part
    cut : (e,) bool; inner edges that are open from the beginning (the notch)
    thickness : float, m
    """
    ends, sides = mesh.inner_edges
    t = len(mesh.corners)
    fused = ~parts & ~cut
    corner = np.stack([_corner(mesh, sides[:, k], ends) for k in (0, 1)], axis=2)  # (e, end, triangle)
    pairs = corner[fused].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (3 * t, 3 * t))
    nodes, label = connected_components(graph, directed=False)
    chosen = parts & ~cut
    label = _numbered(mesh, label, int(nodes), corner[chosen])
    node = label.reshape(t, 3)
    run = mesh.points[ends[chosen, 1]] - mesh.points[ends[chosen, 0]]
    length = np.hypot(*run.T)
    along = run / length[:, None]
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    across = mesh.centre[sides[chosen, 1]] - mesh.centre[sides[chosen, 0]]
    normal *= np.sign(np.sum(normal * across, axis=1))[:, None]
    return Body(
        mesh=mesh,
        node=node,
        nodes=int(nodes),
        ends=label[corner[chosen]],
        sides=sides[chosen],
        middle=mesh.points[ends[chosen]].mean(axis=1),
        frame=np.stack([normal, along], axis=1),
        length=length,
        thickness=thickness,
    )


def _numbered(mesh: Mesh, label: np.ndarray, nodes: int, corner: np.ndarray) -> np.ndarray:
    """Node of every corner (3t,) under numbers in which the stiffness is quick to factorise.

    `corner` (c, 2, 2): corners at the ends of the edges that can part, [edge, end, triangle].
    """
    place = np.zeros((nodes, 2))
    place[label] = mesh.points[mesh.corners.ravel()]
    of_triangle = label.reshape(-1, 3)
    of_edge = label[corner].reshape(-1, 4)
    pairs = np.vstack(
        [of[:, [i, j]] for of in (of_triangle, of_edge) for i in range(of.shape[1]) for j in range(of.shape[1])]
    )
    neighbours = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (nodes, nodes)).tocsr()
    number = np.empty(nodes, int)
    number[dissected(place, neighbours)] = np.arange(nodes)
    return np.asarray(number[label])


def _corner(mesh: Mesh, triangle: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Number 3·triangle + corner of both ends (e, 2) of edges in a triangle (e,) each."""
    here = mesh.corners[triangle]
    local = np.argmax(here[:, None, :] == ends[:, :, None], axis=2)
    return 3 * triangle[:, None] + local


def hanging_together(mesh: Mesh, cut: np.ndarray) -> np.ndarray:
    """Which triangles (t,) belong to the largest part joined over edges that are not cut (e,) bool."""
    _, sides = mesh.inner_edges
    t = len(mesh.corners)
    pairs = sides[~cut]
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (t, t))
    _, label = connected_components(graph, directed=False)
    return label == np.argmax(np.bincount(label, mesh.area))
