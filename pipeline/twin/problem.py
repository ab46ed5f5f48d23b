"""A fracture test on an irregular network that stands for the same material as a hexagonal lattice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import BondLaw, Kinematics, Problem
from pipeline.core.specimen import Specimen
from pipeline.materials.burgers import Burgers
from pipeline.materials.creeping_mixture import creeping_arms
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixture import Mixture
from pipeline.microstructure.attachment import attach_gauge, attach_grips
from pipeline.microstructure.rigid_body import main_part, rigid_part
from pipeline.twin.network import IrregularNetwork

PhaseAt = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Points (n, 2) in m → phase (n,) uint8 and stone number (n,) int32."""


@dataclass(frozen=True)
class Factors:
    """What makes a lattice that is fitted to the irregular network agree with the truth (`twin.calibration`).

    Parameters
    ----------
    stiffness : float; on K^n, so that E agrees
    strength : float; on f_max, so that the strength f_t = √3 f_max/(2rt) agrees
    opening : float; on δ_max, so that G_f = f_max δ_max/(2rt) agrees, together with `strength`
    """

    stiffness: float
    strength: float
    opening: float


@dataclass(frozen=True)
class Truth:
    """The two unknowns of the virtual material, as the identifying lattice counts them.

    Parameters
    ----------
    f_max : float, N; per bond of the hexagonal lattice of `radius` and the specimen's thickness
    delta_max : float, m
    radius : float, m; of the particles of that lattice
    """

    f_max: float
    delta_max: float
    radius: float


def one_phase(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mastic everywhere."""
    return np.full(len(points), Phase.MASTIC, np.uint8), np.zeros(len(points), np.int32)


def twin_problem(
    specimen: Specimen,
    network: IrregularNetwork,
    phase_at: PhaseAt,
    mixture: Mixture,
    truth: Truth,
    factors: Factors,
    cmod_max: float,
    stations: np.ndarray,
    kinematics: Kinematics = Kinematics.SMALL,
    creep: Burgers | None = None,
) -> Problem:
    """Phases, properties, grips and gauge laid on an irregular network; voids are left out.

    A bond carries K^n of its phase times √3 × facet/length (balanced, see `twin.network`), and f_max of its
    phase times facet/(2r/√3), the facet of the hexagonal lattice: both reduce to the lattice's own values. With
    `creep` the mastic relaxes as that, and the problem needs a clock.
    """
    particles, bonds, kept = _lay_phases(specimen, network, phase_at)
    strength, opening = mixture.strength(bonds.phase, truth.f_max, truth.delta_max)
    facet = network.facet[kept] / (2 * truth.radius / np.sqrt(3))
    free = ~bonds.protected
    strength = np.where(free, factors.strength * strength * facet, np.inf)
    opening = np.where(free, factors.opening * opening, np.inf)
    share = factors.stiffness * network.stiffness[kept]
    if creep is None:
        stiffness = mixture.stiffness(bonds.phase, specimen.thickness) * share
        law: BondLaw = mixture.bond_law(stiffness, strength, opening)
    else:
        rise = creeping_arms(mixture, creep, bonds.phase, specimen.thickness)
        slow = CreepingSoftening(rise, strength, opening, mixture.softening, mixture.unloading)
        law = slow.times(share, 1.0, 1.0)
    return Problem(
        specimen=specimen,
        particles=particles,
        bonds=bonds,
        law=law,
        grips=attach_grips(specimen, particles),
        gauge=attach_gauge(specimen, particles),
        kinematics=kinematics,
        cmod_max=cmod_max,
        stations=np.asarray(stations, float),
    )


def _lay_phases(
    specimen: Specimen, network: IrregularNetwork, phase_at: PhaseAt
) -> tuple[Particles, Bonds, np.ndarray]:
    """Particles and bonds that hold, and which bonds of the network those are, (m,) int."""
    phase, stone = _phases(network, phase_at)
    there = (phase == Phase.MASTIC) | (phase == Phase.AGGREGATE)
    if not there.all():
        there = _firm(network, there)
    kept = np.flatnonzero(there[network.pairs].all(axis=1))
    number = np.cumsum(there, dtype=np.int32) - np.int32(1)
    particles = Particles(network.position[there], network.pitch / 2, phase[there], stone[there])
    pairs = number[network.pairs[kept]]
    bonds = Bonds(pairs, _bond_phase(particles, pairs), specimen.protected(particles.position[pairs].mean(axis=1)))
    return particles, bonds, kept


def _phases(network: IrregularNetwork, phase_at: PhaseAt) -> tuple[np.ndarray, np.ndarray]:
    """Phase and stone of every point; those on the edge of the image look half a pitch further in."""
    phase, stone = phase_at(network.position)
    lost = phase == Phase.OUTSIDE
    if not lost.any():
        return phase, stone
    count = len(network.position)
    ends = np.concatenate([network.pairs, network.pairs[:, ::-1]])
    number = np.bincount(ends[:, 0], minlength=count)
    mean = [np.bincount(ends[:, 0], network.position[ends[:, 1], k], count) / number for k in (0, 1)]
    inward = 0.5 * (network.position + np.column_stack(mean))
    phase, stone = phase.copy(), stone.copy()
    phase[lost], stone[lost] = phase_at(inward[lost])
    return phase, stone


def _firm(network: IrregularNetwork, there: np.ndarray) -> np.ndarray:
    """Which points are left when islands and hanging parts beside the voids are taken away; (n,) bool."""
    for part in (lambda position, pairs: main_part(len(position), pairs), rigid_part):
        number = np.cumsum(there) - 1
        pairs = number[network.pairs[there[network.pairs].all(axis=1)]]
        holds = there.copy()
        holds[there] = part(network.position[there], pairs)
        there = holds
    return there


def _bond_phase(particles: Particles, pairs: np.ndarray) -> np.ndarray:
    """Phase of bonds: that of both ends, INTERFACE between two phases, TOUCHING between two stones."""
    first, second = particles.phase[pairs].T
    stone = particles.stone[pairs]
    touching = (first == Phase.AGGREGATE) & (second == Phase.AGGREGATE) & (stone[:, 0] != stone[:, 1])
    phase = np.where(first == second, first, np.uint8(Phase.INTERFACE))
    phase[touching] = Phase.TOUCHING
    return phase
