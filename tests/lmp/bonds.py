"""A bond or a few in LAMMPS, to be moved by hand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from pipeline.lmp.plugin import open_lammps

LENGTH = 6e-4
SMALL, FINITE = "kinematics small", "kinematics finite"


@contextmanager
def chain(
    coefficients: str,
    style: str = SMALL,
    *,
    angle: float = 0.0,
    count: int = 2,
    units: str = "si",
    before: str = "",
    length: float = LENGTH,
    bonds: str = "bond_style cohesive",
    coeff: str = "bond_coeff 1",
    second: str | None = None,
) -> Iterator[Any]:
    """Particles 1 … count in a row in direction `angle` (rad), each joined to the next by an unstretched bond.

    `second` is the line of coefficients of the second bond type, which no bond has.
    """
    lmp = open_lammps()
    places = np.arange(count)[:, None] * length * np.array([np.cos(angle), np.sin(angle)])
    box = 50 * length
    atoms = "\n".join(f"create_atoms 1 single {x:.17g} {y:.17g} 0" for x, y in places)
    joined = "\n".join(f"create_bonds single/bond 1 {k} {k + 1}" for k in range(1, count))
    try:
        lmp.commands_string(f"""
units {units}
dimension 2
boundary f f p
atom_style bond
atom_modify map array
{before}
region box block {-box} {box} {-box} {box} {-length / 2} {length / 2}
create_box 1 box bond/types 2 extra/bond/per/atom 2 extra/special/per/atom 4
{atoms}
mass 1 1.0
pair_style none
comm_modify cutoff {8 * length}
neighbor {length} bin
{bonds} {style}
{coeff} {coefficients}
{second or f"bond_coeff 2 {coefficients}"}
{joined}
compute pairs all property/local batom1 batom2
compute bond all bond/local force engpot b1 b2 b3 b4 b5 b6 b7 b8 b9 b10
thermo_style custom step pe ke
run 0 post no
""")
        yield lmp
    finally:
        lmp.close()


def forces(lmp: Any, count: int = 2) -> np.ndarray:
    """Forces (count, 2) on particles 1 … count."""
    order = np.argsort(lmp.numpy.extract_atom("id")[:count])
    return lmp.numpy.extract_atom("f")[order, :2].copy()


def rows(lmp: Any) -> np.ndarray:
    """Rows of compute bond/local: force, energy, opening, delta_reached, damage, tension, sliding, shear, used, …"""
    lmp.command("run 0 post no")
    return lmp.numpy.extract_compute("bond", 2, 2).copy()
