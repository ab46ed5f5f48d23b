"""A problem's particles and bonds as a LAMMPS data file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.core.particles import Phase
from pipeline.core.problem import Problem
from pipeline.lmp.law_table import LawTable

TYPES = (Phase.MASTIC, Phase.AGGREGATE)


def write_data_file(
    path: Path, problem: Problem, table: LawTable, velocity: np.ndarray, spin: np.ndarray | None = None
) -> None:
    """Write particles (molecule = stone number), initial velocities (n, 2) in m/s, and bonds.

    Atom style `bond`, SI units, z = 0; particle i of the problem is atom i + 1. Where particles rotate, `spin` (n,) in
    rad/s goes to a section `Rotations` of angle, spin, torque and moment of inertia, which the drive sets.
    """
    particles, bonds = problem.particles, problem.bonds
    margin = 10 * particles.radius + problem.cmod_max
    low, high = particles.position.min(axis=0) - margin, particles.position.max(axis=0) + margin
    half = particles.radius
    head = [
        f"{problem.specimen.geometry} specimen, SI units; molecule is the stone number",
        "",
        f"{particles.count} atoms",
        f"{bonds.count} bonds",
        f"{len(TYPES)} atom types",
        f"{len(table.coefficients)} bond types",
        "",
        f"{low[0]:.9g} {high[0]:.9g} xlo xhi",
        f"{low[1]:.9g} {high[1]:.9g} ylo yhi",
        f"{-half:.9g} {half:.9g} zlo zhi",
        "",
        "Masses",
        "",
        *(f"{k} 1.0 # {phase.name.lower()}" for k, phase in enumerate(TYPES, 1)),
    ]
    kind = np.where(particles.phase == Phase.AGGREGATE, 2, 1)
    number = np.arange(1, particles.count + 1)
    atoms = zip(number, particles.stone, kind, *particles.position.T, strict=True)
    moves = zip(number, *velocity.T, strict=True)
    pairs = zip(np.arange(1, bonds.count + 1), table.type + 1, *(bonds.pairs.T + 1), strict=True)
    with path.open("w", encoding="ascii") as out:
        out.write("\n".join(head))
        out.write("\n\nAtoms # bond\n\n")
        out.writelines(f"{i} {s} {k} {x:.17g} {y:.17g} 0\n" for i, s, k, x, y in atoms)
        out.write("\nVelocities\n\n")
        out.writelines(f"{i} {u:.17g} {v:.17g} 0\n" for i, u, v in moves)
        if spin is not None:
            out.write("\nRotations\n\n")
            out.writelines(f"{i} 0 {w:.17g} 0 0\n" for i, w in zip(number, spin, strict=True))
        out.write("\nBonds\n\n")
        out.writelines(f"{b} {t} {i} {j}\n" for b, t, i, j in pairs)
