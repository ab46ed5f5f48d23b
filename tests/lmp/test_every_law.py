"""Bonds in LAMMPS itself along every path of the table: forces, torques, energies, histories of the laws in NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from agreement.following import python, scales
from agreement.law_table import TABLE

from pipeline.lmp.law_table import Law, coefficients
from pipeline.lmp.plugin import open_lammps
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening

from .bonds import FINITE, SMALL

LENGTH = 6e-3  # m; the paths press bonds by up to 1 mm, which finite kinematics must survive
ASKED = 1e-10  # of the natural scales; openings are differences of positions of 6e-3 m, which leaves 1e-11
TIMELESS = [name for name, (law, _) in TABLE.items() if not isinstance(law, CreepingSoftening)]
TIMED = [name for name in TABLE if name not in TIMELESS]
COLUMNS = 10  # of compute bond/local: force, energy, opening, reached, damage, tension, sliding, shear, used, history


@contextmanager
def pairs(laws: list[Law], style: str) -> Iterator[Any]:
    """One bond a law, each of a type of its own; all lie upon each other, their first particles at the origin."""
    lmp, kinds = open_lammps(), range(1, len(laws) + 1)
    atoms = f"create_atoms 1 single 0 0 0\ncreate_atoms 1 single {LENGTH} 0 0\n" * len(laws)
    try:
        lmp.commands_string(f"""
units si
dimension 2
boundary f f p
atom_style bond
atom_modify map array
newton off
region box block -0.02 0.02 -0.02 0.02 -0.001 0.001
create_box 1 box bond/types {len(laws)} extra/bond/per/atom 1 extra/special/per/atom 1
{atoms}
mass 1 1.0
pair_style none
comm_modify cutoff 0.02
neighbor 0.0005 bin
bond_style cohesive {style}
""")
        for k, law in zip(kinds, laws, strict=True):
            lmp.commands_string(
                f"bond_coeff {k} {coefficients(law, 0)}\ncreate_bonds single/bond {k} {2 * k - 1} {2 * k}"
            )
        columns = " ".join(f"b{k}" for k in range(1, COLUMNS - 1))
        lmp.commands_string(
            f"compute ends all property/local batom1\ncompute bond all bond/local force engpot {columns}"
        )
        lmp.command("run 0 post no")
        yield lmp
    finally:
        lmp.close()


def seen(lmp: Any) -> np.ndarray:
    """The rows of `python`, one a bond in the order of their types."""
    lmp.command("run 0 post no")
    table = lmp.numpy.extract_compute("bond", 2, 2)[np.argsort(lmp.numpy.extract_compute("ends", 2, 1))]
    return table[:, [5, 7, 1, 8, 3, 4, 9]]


def placed(opening: np.ndarray, sliding: np.ndarray, style: str) -> np.ndarray:
    """Where the second particles are."""
    if style == SMALL:
        return np.column_stack([LENGTH + opening, sliding])
    distance, turn = LENGTH + opening, sliding / LENGTH
    return np.column_stack([distance * np.cos(turn), distance * np.sin(turn)])


def pulls(rows: np.ndarray, at: np.ndarray, style: str) -> np.ndarray:
    """Forces on the first particles from those along and across the bonds."""
    distance = np.hypot(*at.T)[:, None]
    along = at / distance if style == FINITE else np.tile([1.0, 0.0], (len(at), 1))
    lever = LENGTH / distance if style == FINITE else 1.0
    return rows[:, :1] * along + rows[:, 1:2] * lever * np.column_stack([-along[:, 1], along[:, 0]])


def assert_as_defined(names: list[str], style: str) -> None:
    """Every number of every step of these laws' paths, and the forces on the particles."""
    laws, paths = [TABLE[n][0] for n in names], [TABLE[n][1] for n in names]
    expected = [python(law, path) for law, path in zip(laws, paths, strict=True)]
    natural = np.array([scales(law, rows) for law, rows in zip(laws, expected, strict=True)])
    slides = np.array([isinstance(law, MixedSoftening) for law in laws])
    tolerance = np.where(slides[:, None], [*[ASKED] * 4, 1e-9, ASKED, ASKED], ASKED)  # as in agreement/test_law.py
    steps = max(map(len, paths))
    with pairs(laws, style) as lmp:
        order = np.argsort(lmp.numpy.extract_atom("id")[: 2 * len(laws)])
        first, second = order[::2], order[1::2]
        for k in range(steps):
            now = np.array([path[min(k, len(path) - 1)] for path in paths])
            at = placed(now[:, 0], now[:, 1], style)
            lmp.numpy.extract_atom("x")[second, :2] = at
            if len(names) == 1:
                lmp.command(f"timestep {now[0, 2]:.17g}")
                lmp.command("run 1 pre no post no")
            rows, wanted = seen(lmp), np.array([e[min(k, len(e) - 1)] for e in expected])
            wanted[~slides, 6], rows[~slides, 6] = 0.0, 0.0
            going = np.array([k < len(path) for path in paths])  # rubbing goes on by roundings where nothing moves
            apart = np.abs(rows - wanted) / natural
            assert np.all((apart < tolerance)[going]), (k, apart[going].max(axis=0))
            force = lmp.numpy.extract_atom("f")
            pull, scale = pulls(wanted, at, style), natural[:, :1]
            assert np.all((np.abs(force[first, :2] - pull) / scale < ASKED)[going])
            assert np.all(force[first] == -force[second]), "to the last bit"
            if slides.any():
                turn = lmp.numpy.extract_atom("d_cohesive_torque")
                twist = 0.5 * LENGTH * wanted[:, 1]
                for end in (first, second):
                    assert np.all((np.abs(turn[end] - twist) / (LENGTH * scale[:, 0]) < ASKED)[going])


@pytest.mark.parametrize("style", [SMALL, FINITE])
def test_laws_without_time(style: str) -> None:
    assert_as_defined(TIMELESS, style)


@pytest.mark.parametrize("style", [SMALL, FINITE])
@pytest.mark.parametrize("name", TIMED)
def test_laws_that_creep(name: str, style: str) -> None:
    assert_as_defined([name], style)
