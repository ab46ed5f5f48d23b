"""Phases laid on a packing: which particles and bonds there are, and what they are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.specimen import Specimen
from pipeline.microstructure.packing import Packing
from pipeline.microstructure.phase_map import PhaseMap
from pipeline.microstructure.rigid_body import main_part, rigid_part

LARGEST_OUTSIDE = 0.02
"""Share of the specimen that may lie outside the image or on pixels labelled outside."""

LARGEST_LOOSE = 0.10
"""Share of the particles that may be taken away because they do not hold to the main part."""


@dataclass(frozen=True)
class PackingReport:
    """What became of the places of a packing.

    Parameters
    ----------
    places : int; lattice points in the specimen
    outside : int; places where the image shows nothing: no particle
    void : int; places in a void: no particle
    islands : int; particles taken away because no bonds lead to the main part
    loose : int; particles taken away because they hang on fewer than two bonds, on bonds in one line, or
        turn about a hinge (singular where bonds carry no shear)
    particles, bonds : int; what is left
    stones : int; stones that hold at least one particle
    aggregate_fraction : float; share of aggregate among the particles
    bonds_by_phase : tuple of (Phase, int); bonds of each phase that occurs
    """

    places: int
    outside: int
    void: int
    islands: int
    loose: int
    particles: int
    bonds: int
    stones: int
    aggregate_fraction: float
    bonds_by_phase: tuple[tuple[Phase, int], ...]


def lay_phases(
    specimen: Specimen,
    packing: Packing,
    phase_map: PhaseMap | None = None,
    largest_outside: float = LARGEST_OUTSIDE,
) -> tuple[Particles, Bonds, PackingReport]:
    """Give the places of a packing their phase; leave out voids and what does not hold.

    A particle takes the phase of the pixel under its centre (Hill et al. 2017, Fig. 7), mastic without an
    image. A bond within one phase is of that phase, one between aggregate and mastic an interface, one
    between two stones touching; a bond whose midpoint lies in a protected region takes no damage.

    Parameters
    ----------
    specimen : Specimen
    packing : Packing of this specimen
    phase_map : PhaseMap or None; None is mastic throughout
    largest_outside : float; share of the specimen that may lie outside the image

    Raises
    ------
    InputError
        if too much of the specimen lies outside the image, or too much does not hold together
    """
    phase, stone = _phases_at(packing.position, phase_map)
    outside, void = phase == Phase.OUTSIDE, phase == Phase.VOID
    _refuse_outside(np.count_nonzero(outside) / phase.size, largest_outside)
    solid = ~(outside | void)
    joined = solid.copy()
    joined[solid] = main_part(int(np.count_nonzero(solid)), _pairs_among(packing.pairs, solid))
    firm = joined.copy()
    firm[joined] = rigid_part(packing.position[joined], _pairs_among(packing.pairs, joined))
    _refuse_loose(1 - np.count_nonzero(firm) / np.count_nonzero(solid))
    particles = Particles(packing.position[firm], packing.radius, phase[firm], stone[firm])
    bonds = _bonds(specimen, particles, _pairs_among(packing.pairs, firm))
    count = [int(np.count_nonzero(k)) for k in (outside, void, solid & ~joined, joined & ~firm)]
    return particles, bonds, _report(phase.size, count, particles, bonds)


def _phases_at(position: np.ndarray, phase_map: PhaseMap | None) -> tuple[np.ndarray, np.ndarray]:
    if phase_map is None:
        return np.full(len(position), Phase.MASTIC, np.uint8), np.zeros(len(position), np.int32)
    return phase_map.at(position)


def _pairs_among(pairs: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The pairs whose two particles are kept, numbered among those."""
    number = np.cumsum(kept, dtype=np.int32) - np.int32(1)
    return number[pairs[kept[pairs].all(axis=1)]]


def _bonds(specimen: Specimen, particles: Particles, pairs: np.ndarray) -> Bonds:
    first, second = particles.phase[pairs].T
    stone = particles.stone[pairs]
    touching = (first == Phase.AGGREGATE) & (second == Phase.AGGREGATE) & (stone[:, 0] != stone[:, 1])
    phase = np.where(first == second, first, np.uint8(Phase.INTERFACE))
    phase[touching] = Phase.TOUCHING
    return Bonds(pairs, phase, specimen.protected(particles.position[pairs].mean(axis=1)))


def _report(places: int, count: list[int], particles: Particles, bonds: Bonds) -> PackingReport:
    numbers, times = np.unique(bonds.phase, return_counts=True)
    return PackingReport(
        places,
        outside=count[0],
        void=count[1],
        islands=count[2],
        loose=count[3],
        particles=particles.count,
        bonds=bonds.count,
        stones=np.unique(particles.stone[particles.stone > 0]).size,
        aggregate_fraction=float(np.mean(particles.phase == Phase.AGGREGATE)),
        bonds_by_phase=tuple((Phase(k), int(n)) for k, n in zip(numbers, times, strict=True)),
    )


def _refuse_outside(share: float, largest: float) -> None:
    if share > largest:
        raise InputError(
            f"{share:.0%} of the specimen lies outside its image (beyond the edge, or labelled 0), at most "
            f"{largest:.0%} may: check mm_per_px, origin_px and rotation_deg of [specimen.image], or a whole image"
        )


def _refuse_loose(share: float) -> None:
    if share > LARGEST_LOOSE:
        raise InputError(
            f"{share:.0%} of the particles do not hold to the main part of the specimen, at most {LARGEST_LOOSE:.0%} "
            "may: check the voids of the image, or use a smaller particle radius"
        )
