"""A bar in tension between ends that slide freely along themselves: closed forms, and what a zigzag crack costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, vstack

from pipeline.blind.body import Body, join
from pipeline.blind.bulk import Bulk, Relaxation, elasticity
from pipeline.blind.equilibrium import Setup
from pipeline.blind.machine import Contact, Machine
from pipeline.blind.mesh import Zone, triangulate
from pipeline.blind.sample import PENALTY
from pipeline.blind.traction import Branch, Edges

E, NU, STRENGTH, ENERGY, THICKNESS = 10e9, 0.2, 4e6, 200.0, 0.04


@dataclass(frozen=True)
class Bar:
    """A rectangle without a notch: the notch line has no length."""

    length: float = 24e-3
    height: float = 24e-3
    notch_width: float = 1e-12
    tip: tuple[float, float] = (0.0, 0.0)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        return (-self.length / 2, 0.0, self.length / 2, self.height)

    def contains(self, points: np.ndarray) -> np.ndarray:
        x0, y0, x1, y1 = self.bounds
        return (points[:, 0] >= x0) & (points[:, 0] <= x1) & (points[:, 1] >= y0) & (points[:, 1] <= y1)

    def outline(self) -> list[np.ndarray]:
        x0, y0, x1, y1 = self.bounds
        box = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])
        return [box, box]


def bar_body(edge: float, seed: int, bar: Bar | None = None, free: float = 0.25) -> Body:
    """Triangles that can part in the middle of the bar, `free` of its length to both sides."""
    bar = bar or Bar()
    zone = Zone(free * bar.length, 0.0, bar.height)
    mesh, _ = triangulate(bar, zone, edge, np.random.default_rng(seed))
    ends, _ = mesh.inner_edges
    middle = mesh.points[ends].mean(axis=1)
    return join(mesh, zone.holds(middle), np.zeros(len(ends), bool), THICKNESS)


def pulled(body: Body, edge: float, bar: Bar | None = None, beta: float = 1.0, relaxation: Relaxation | None = None,
           tail: float = 0.0, **more: float) -> Setup:  # fmt: skip
    """The bar pulled by its ends, which slide freely along themselves."""
    bar = bar or Bar()
    spots = np.linspace(0.02, 0.98, 25) * bar.height
    half, contacts = bar.length / 2, []
    for name, side in (("right", 1.0), ("left", -1.0)):
        rows = body.row(np.column_stack([np.full(spots.size, side * half), spots]), np.array([side, 0.0]))
        contacts += [Contact(f"{name}{k}", rows[k], None, float(side > 0), side > 0) for k in range(spots.size)]
    corner = body.row(np.array([(-half, bar.height / 2)]), np.array([0.0, 1.0]))
    contacts.append(Contact("corner", corner, None, 0.0, False))
    gauge = csr_matrix(vstack([c.row for c in contacts[:-1]]).sum(axis=0)) / spots.size
    t, q = len(body.mesh.corners), 2 * len(body.ends)
    edges = Edges(
        penalty=np.full(q, PENALTY * E / edge),
        strength=np.full(q, STRENGTH),
        last=np.full(q, 2 * ENERGY / STRENGTH),
        beta=beta,
        branch=Branch(tail),
    )
    bulk = Bulk(elasticity(NU, "stress"), np.full(t, E), np.ones(t, bool), relaxation or Relaxation())
    return Setup(body, Machine(tuple(contacts), gauge), edges, bulk, np.zeros(q), **more)
