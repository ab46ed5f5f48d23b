"""Small specimens whose answer is known or whose solve takes a second."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import Gauge, Grip, Kinematics, Problem, Role
from pipeline.core.specimen import DiskCompactTension, SingleEdgeNotchedBeam, Specimen
from pipeline.core.units import GPA, MM
from pipeline.materials.cohesive import LinearSoftening
from pipeline.materials.elastic import Plane, normal_stiffness
from pipeline.microstructure.attachment import attach_gauge, attach_grips
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phases import lay_phases

BEAM = SingleEdgeNotchedBeam(depth=60 * MM, span=130 * MM, length=137 * MM, thickness=40 * MM, notch_length=15 * MM)
DISK = DiskCompactTension(
    diameter=150 * MM, width=110 * MM, edge_to_load_line=35 * MM, thickness=50 * MM, notch_length=27.5 * MM
)
MODULUS = 10 * GPA


def fracture_test(
    specimen: Specimen = BEAM,
    radius: float = 1.5 * MM,
    strength: float = 71.0,
    opening: float = 1.14e-4,
    kinematics: Kinematics = Kinematics.SMALL,
    angle: float = np.pi / 2,
    scatter: float = 0.0,
) -> Problem:
    """A specimen in plane strain; mean strength (N) for 0.3 mm radius and 40 mm thickness, and its relative scatter."""
    particles, bonds, _ = lay_phases(specimen, hexagonal_packing(specimen, radius, angle))
    stiffness = np.full(bonds.count, normal_stiffness(MODULUS, 0.25, Plane.STRAIN, specimen.thickness))
    f_max = strength * (radius / (0.3 * MM)) * (specimen.thickness / (40 * MM))
    f_max = f_max * np.random.default_rng(5).uniform(1 - scatter, 1 + scatter, bonds.count)
    law = LinearSoftening(stiffness, np.where(bonds.protected, np.inf, f_max), np.full(bonds.count, opening))
    return Problem(
        specimen=specimen,
        particles=particles,
        bonds=bonds,
        law=law,
        grips=attach_grips(specimen, particles),
        gauge=attach_gauge(specimen, particles),
        kinematics=kinematics,
        cmod_max=0.5 * MM,
        stations=np.array([0.1, 0.2, 0.3]) * MM,
    )


def elastic(problem: Problem) -> Problem:
    """The same test without damage."""
    law = problem.law
    return problem.with_law(LinearSoftening(law.k_n, np.full_like(law.k_n, np.inf), law.k_n))


def chain(spring: float, law: LinearSoftening, cmod_max: float, kinematics: Kinematics = Kinematics.SMALL) -> Problem:
    """A cohesive bond in series with a spring (N/m): three particles on the x axis, pulled at the spring.

    The gauge spans the cohesive bond, whose law (one entry) is therefore the load–CMOD curve.
    """
    particles, bonds = _mastic(np.array([[0.0, 0.0], [1 * MM, 0.0], [2 * MM, 0.0]]), np.array([[0, 1], [1, 2]]))
    both = LinearSoftening(np.append(law.k_n, spring), np.append(law.f_max, np.inf), np.append(law.delta_max, np.inf))
    grips = (
        _grip("left", [0], (-1.0, 0.0), 0.0, Role.REACT),
        _grip("right", [2], (1.0, 0.0), 1.0, Role.DRIVE),
        *(_grip(f"line_{i}", [i], (0.0, 1.0), 0.0, Role.GUIDE) for i in range(3)),
    )
    gauge = Gauge(np.array([1, 0]), np.array([1.0, -1.0]))
    stations = np.linspace(0.2, 0.8, 4) * cmod_max
    return Problem(BEAM, particles, bonds, both, grips, gauge, kinematics, cmod_max, stations)


def strip(columns: int, rows: int, stiffness: float) -> Problem:
    """A rectangle of hexagonal lattice, rows along x, whose ends move along x as under uniform strain."""
    radius = 1 * MM
    line, place = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    x = (2 * radius * (place + 0.5 * (line % 2))).ravel()
    position = np.column_stack([x, (np.sqrt(3) * radius * line).ravel()])
    distance = np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1))
    particles, bonds = _mastic(position, np.argwhere(np.triu(distance < 2.1 * radius, 1)))
    ends = np.flatnonzero(np.isin(place.ravel(), (0, columns - 1)))
    grips = tuple(_grip(f"end_{i}", [i], (1.0, 0.0), x[i] / x.max(), Role.DRIVE) for i in ends)
    grips += (_grip("line", [0], (0.0, 1.0), 0.0, Role.GUIDE),)
    first, last = int(np.argmin(x)), int(np.argmax(x))
    gauge = Gauge(np.array([last, first]), np.array([1.0, -1.0]))
    m = bonds.count
    law = LinearSoftening(np.full(m, stiffness), np.full(m, np.inf), np.full(m, np.inf))
    return Problem(BEAM, particles, bonds, law, grips, gauge, Kinematics.SMALL, 1e-4, np.array([5e-5]))


def scaled(problem: Problem, factor: float) -> Problem:
    """Strengths, openings, CMOD range and stations times a factor."""
    law = LinearSoftening(problem.law.k_n, factor * problem.law.f_max, factor * problem.law.delta_max)
    return replace(problem, law=law, cmod_max=factor * problem.cmod_max, stations=factor * problem.stations)


def mirrored(problem: Problem) -> Problem:
    """The same specimen and test seen from behind: x → −x."""
    particles = replace(problem.particles, position=problem.particles.position * (-1, 1))
    grips = tuple(replace(g, direction=np.asarray(g.direction) * (-1, 1)) for g in problem.grips)
    gauge = Gauge(problem.gauge.index, -problem.gauge.weight)
    return replace(problem, particles=particles, grips=grips, gauge=gauge)


def _mastic(position: np.ndarray, pairs: np.ndarray) -> tuple[Particles, Bonds]:
    n, m = len(position), len(pairs)
    particles = Particles(position, 0.5 * MM, np.full(n, Phase.MASTIC, np.uint8), np.zeros(n, np.int32))
    return particles, Bonds(pairs.astype(np.int32), np.full(m, Phase.MASTIC, np.uint8), np.zeros(m, bool))


def _grip(name: str, index: list[int], direction: tuple[float, float], drive: float, role: Role) -> Grip:
    return Grip(name, np.array(index), np.full(len(index), 1 / len(index)), np.array(direction), drive, role)
