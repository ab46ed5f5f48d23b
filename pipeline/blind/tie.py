"""Edges that are far from parting are tied: their triangles share their motion, and the equations are fewer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.blind.body import Body
from pipeline.blind.bulk import Bulk
from pipeline.blind.traction import Edges

LOOSENED, TOO_LATE = 0.5, 0.9  # of its strength: stress at which an edge is let loose; at which it should have been


@dataclass(frozen=True, eq=False)
class Tie:
    """A body of which some edges are tied.

    Parameters
    ----------
    body : Body
    loose : (c,) bool; edges that are not tied
    """

    body: Body
    loose: np.ndarray

    @cached_property
    def spread(self) -> csr_matrix:
        """(size, n): displacements of all nodes from those that are independent, in the order of their elimination."""
        pairs = self.body.ends[~self.loose].reshape(-1, 2)
        nodes = self.body.nodes
        graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (nodes, nodes))
        count, label = connected_components(graph, directed=False)
        last = np.zeros(count, int)
        np.maximum.at(last, label, np.arange(nodes))  # one that touches a cut belongs to it
        rank = np.empty(count, int)
        rank[np.argsort(last)] = np.arange(count)
        column = (2 * rank[label][:, None] + (0, 1)).ravel()
        return coo_matrix((np.ones(2 * nodes), (np.arange(2 * nodes), column)), (2 * nodes, 2 * count)).tocsr()

    @cached_property
    def share(self) -> np.ndarray:
        """(n,) array; one over how many nodes move as each."""
        return 1 / np.asarray(self.spread.sum(axis=0)).ravel()

    @cached_property
    def points(self) -> np.ndarray:
        """(2c,) bool; ends of edges that are not tied."""
        return np.repeat(self.loose, 2)

    @cached_property
    def opener(self) -> csr_matrix:
        """Openings at these, from the independent displacements."""
        return (self.body.opener[np.repeat(self.points, 2)] @ self.spread).tocsr()

    def gathered(self, moved: np.ndarray) -> np.ndarray:
        """Independent displacements (n,) of displacements (size,) that keep to the ties."""
        return np.asarray((self.spread.T @ moved) * self.share)


def strained(body: Body, bulk: Bulk, edges: Edges, moved: np.ndarray) -> np.ndarray:
    """Which share of its strength every edge (c,) carries, by the triangle beside it that says more.

    Mastic that creeps counts as elastic, which says more, too.
    """
    strain = np.einsum("tai,ti->ta", body.strain, moved[body.own])
    stress = (strain @ bulk.elasticity) * bulk.modulus[:, None]
    normal, along = body.frame[:, 0], body.frame[:, 1]
    found = np.zeros(len(body.ends))
    for side in (0, 1):
        s = stress[body.sides[:, side]]
        pull = np.column_stack(
            [s[:, 0] * normal[:, 0] + s[:, 2] * normal[:, 1], s[:, 2] * normal[:, 0] + s[:, 1] * normal[:, 1]]
        )
        across, aside = np.sum(pull * normal, axis=1), np.sum(pull * along, axis=1)
        found = np.maximum(found, np.hypot(np.maximum(across, 0.0), aside / max(edges.beta, 1e-3)))
    return np.asarray(found / edges.strength[::2])
