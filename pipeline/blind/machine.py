"""What holds and drives a specimen: rollers and pins as stiff springs on the mean motion of a patch, a clip gauge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, vstack

from pipeline.blind.body import Body
from pipeline.core.errors import UnavailableError
from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam, Specimen

STIFF = 5e9  # N/m; of a roller or pin, a hundred times stiffer than the specimens
SPOTS = 9  # places over which a roller or pin presses
HALF_ROLLER = 1.5e-3  # m


@dataclass(frozen=True, eq=False)
class Contact:
    """A spring between the machine and the mean displacement of a patch along a direction.

    Parameters
    ----------
    name : str
    row : (1, size) sparse; mean displacement along the direction
    rub : (1, size) sparse or None; what friction pulls at, times the contact's force
    drive : float; 1 moves with the machine
    load : bool; its force is the machine's load
    """

    name: str
    row: csr_matrix
    rub: csr_matrix | None
    drive: float
    load: bool

    def force(self, moved: np.ndarray, machine: float) -> float:
        """Force (N) on the specimen along the direction."""
        return STIFF * (self.drive * machine - float((self.row @ moved)[0]))


@dataclass(frozen=True, eq=False)
class Machine:
    """All contacts of a specimen, and its gauge (1, size)."""

    contacts: tuple[Contact, ...]
    gauge: csr_matrix

    @cached_property
    def rows(self) -> csr_matrix:
        """(contacts, size): their mean displacements."""
        return vstack([c.row for c in self.contacts]).tocsr()

    @cached_property
    def drive(self) -> np.ndarray:
        """(contacts,)"""
        return np.array([c.drive for c in self.contacts])

    @cached_property
    def stiffness(self) -> csr_matrix:
        """Of all contacts, N/m; (size, size)."""
        return (STIFF * self.rows.T @ self.rows).tocsr()

    def push(self, machine: float) -> np.ndarray:
        """Forces (size,) of the springs at rest in the specimen's first state."""
        force: np.ndarray = STIFF * machine * (self.rows.T @ self.drive)
        return force

    def stored(self, moved: np.ndarray, machine: float) -> float:
        """Energy (J) in the springs."""
        return float(0.5 * STIFF * np.sum((self.drive * machine - self.rows @ moved) ** 2))

    def load(self, moved: np.ndarray, machine: float) -> float:
        """The machine's load (N)."""
        return sum(c.force(moved, machine) for c in self.contacts if c.load)

    def friction(self, moved: np.ndarray, machine: float, coefficient: float) -> np.ndarray:
        """Forces (size,) of full slip where contacts rub."""
        total = np.zeros(self.gauge.shape[1])
        for c in self.contacts:
            if c.rub is not None:
                total += coefficient * c.force(moved, machine) * c.rub.toarray()[0]
        return total

    def cmod(self, moved: np.ndarray) -> float:
        """What the clip gauge reads (m)."""
        return float((self.gauge @ moved)[0])


def machine_of(body: Body, specimen: Specimen, eccentricity: float = 0.0) -> Machine:
    """Rollers of a beam or pins of a disk, and the gauge across the mouth; `eccentricity` (m) of a beam's platen."""
    if isinstance(specimen, SingleEdgeNotchedBeam):
        contacts = _rollers(body, specimen, eccentricity)
    elif isinstance(specimen, DiskCompactTension):
        if eccentricity:
            raise UnavailableError("a disk has no platen: eccentricity_mm is for beams")
        contacts = _pins(body, specimen)
    else:
        raise UnavailableError(f"the blind check knows no machine for geometry {specimen.geometry!r}")
    return Machine(contacts, _gauge(body, specimen))


def _mean(
    body: Body, places: np.ndarray, direction: tuple[float, float], weight: np.ndarray | None = None
) -> csr_matrix:
    """Weighted mean displacement along a direction at places (n, 2); (1, size)."""
    share = np.full(len(places), 1 / len(places)) if weight is None else weight / weight.sum()
    return csr_matrix(share[None] @ body.row(places, np.asarray(direction)))


def _rollers(body: Body, beam: SingleEdgeNotchedBeam, eccentricity: float) -> tuple[Contact, ...]:
    spread = np.linspace(-1, 1, SPOTS) * HALF_ROLLER

    def patch(x: float, y: float) -> np.ndarray:
        return np.column_stack([np.clip(x + spread, -beam.length / 2, beam.length / 2), np.full(SPOTS, y)])

    half, top = beam.span / 2, patch(eccentricity, beam.depth)
    left, right = patch(-half, 0.0), patch(half, 0.0)
    return (
        Contact("platen", _mean(body, top, (0.0, -1.0)), None, 1.0, True),
        Contact("left", _mean(body, left, (0.0, 1.0)), _mean(body, left, (1.0, 0.0)), 0.0, False),
        Contact("right", _mean(body, right, (0.0, 1.0)), _mean(body, right, (-1.0, 0.0)), 0.0, False),
        Contact("centre", _mean(body, top, (1.0, 0.0)), None, 0.0, False),
    )


def _pins(body: Body, disk: DiskCompactTension) -> tuple[Contact, ...]:
    turn = np.linspace(-np.pi / 6, np.pi / 6, SPOTS)
    radius, found = disk.pin_diameter / 2, []
    for name, side in (("right", 1.0), ("left", -1.0)):
        centre = np.array(disk.holes()[name])
        rim = centre + radius * np.column_stack([side * np.cos(turn), np.sin(turn)])
        pull = _mean(body, rim, (side, 0.0), np.cos(turn))
        rub = _couple(body, centre, radius, -side)
        found += [
            Contact(name, pull, rub, 1.0 if side > 0 else 0.0, side > 0),
            Contact(f"{name}_line", _mean(body, rim, (0.0, 1.0)), None, 0.0, False),
        ]
    return tuple(found)


def _couple(body: Body, centre: np.ndarray, radius: float, sense: float) -> csr_matrix:
    """A couple of pin radius times one, around a hole, counter-clockwise for `sense` 1; (1, size)."""
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    rows = [
        body.row(centre + radius * ring[k : k + 1], np.array([-ring[k, 1], ring[k, 0]])) * (sense / turn.size)
        for k in range(turn.size)
    ]
    return csr_matrix(vstack(rows).sum(axis=0))


def _gauge(body: Body, specimen: Specimen) -> csr_matrix:
    """Opening between the knife edges; edges outside the specimen move with the triangle next to them."""
    half = specimen.gauge_length / 2
    places = np.array([(half, specimen.gauge_y), (-half, specimen.gauge_y)])
    near = np.array([(half, max(specimen.gauge_y, 0.0)), (-half, max(specimen.gauge_y, 0.0))])
    held = np.array([_on_side(body, place) for place in near])
    rows = body.row_in(held, places, np.array([1.0, 0.0]))
    return csr_matrix(rows[0] - rows[1])


def _on_side(body: Body, place: np.ndarray) -> int:
    """The triangle nearest to a place on its own side of the notch."""
    centre = body.mesh.centre
    own = np.sign(centre[:, 0]) == np.sign(place[0])
    away = np.where(own, np.hypot(*(centre - place).T), np.inf)
    inside = int(body.mesh.triangle_at(place[None])[0])
    return inside if inside >= 0 and own[inside] else int(np.argmin(away))
