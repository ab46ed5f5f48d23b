"""Memory goes where its atoms go: from rank to rank, through a periodic boundary, sorted on the way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from .bonds import FINITE, LENGTH, SMALL
from .test_simulate import run_deck

PLAIN = "3.7e8 71.0 1.14e-4"
LAWS = {
    "central": PLAIN,
    "sliding": f"{PLAIN} shear 1e8 50 2e-4 friction 0.4",
    "creeping": f"{PLAIN} relax 2 0.5 3e-5 0.4 1e-3",
}
COUNT, BOX, STEPS, STEP = 8, 0.016, 150, 1e-6  # atoms, m, steps, s


def script(law: str, style: str, newton: str, speed: float) -> str:
    """A chain is softened, let go a little, and then carried along as it is, at `speed` in m/s."""
    atoms = "\n".join(f"create_atoms 1 single {(k + 0.3) * LENGTH} {0.2 * LENGTH * (-1) ** k} 0" for k in range(COUNT))
    bonds = "\n".join(f"create_bonds single/bond 1 {k} {k + 1}" for k in range(1, COUNT))
    turned = "set atom 3*5 d_cohesive_theta 2e-3" if "shear" in law else ""
    columns = " ".join(f"b{k}" for k in range(1, 8))
    return f"""
units si
dimension 2
boundary p p p
newton {newton}
atom_style bond
atom_modify map array sort 10 0.001
region box block 0 {BOX} {-4 * LENGTH} {4 * LENGTH} {-LENGTH / 2} {LENGTH / 2}
create_box 1 box bond/types 1 extra/bond/per/atom 2 extra/special/per/atom 4
{atoms}
mass 1 1.0
pair_style none
comm_modify cutoff {4 * LENGTH}
neighbor {LENGTH / 2} bin
neigh_modify every 10 delay 0 check no
bond_style cohesive {style}
bond_coeff 1 {law}
{bonds}
timestep {STEP}
run 0 post no
displace_atoms all ramp x 0 2e-4 x 0 {COUNT * LENGTH} units box
{turned}
run 0 post no
displace_atoms all ramp x 0 -5e-5 x 0 {COUNT * LENGTH} units box
fix carry all move linear {speed:.17g} 0 0 units box
run {STEPS} post no
compute ends all property/local batom1 batom2
compute bonds all bond/local force engpot {columns}
dump bonds all local 1 bonds.txt c_ends[1] c_ends[2] c_bonds[*]
dump_modify bonds format float %.17g
dump forces all custom 1 forces.txt id fx fy
dump_modify forces sort id format float %.17g
run 0 post no
"""


def found(folder: Path, text: str, ranks: int) -> tuple[np.ndarray, np.ndarray]:
    """Forces (atoms, 2) and the rows of all bonds, sorted."""
    folder.mkdir()
    (folder / "fracture.lmp").write_text(text)
    run_deck(folder, ranks=ranks)
    tables = []
    for name, head in (("forces.txt", "ITEM: ATOMS"), ("bonds.txt", "ITEM: ENTRIES")):
        _, _, body = (folder / name).read_text().partition(head)
        tables.append(np.array([row.split() for row in body.splitlines()[1:]], float))
    tables[1][:, :2].sort(axis=1)
    return tables[0][:, 1:], tables[1][np.lexsort(tables[1][:, 1::-1].T)]


@pytest.mark.parametrize(("style", "newton"), [(SMALL, "on"), (FINITE, "off")])
@pytest.mark.parametrize("name", LAWS)
def test_a_carried_chain_pulls_as_one_at_rest(name: str, style: str, newton: str, tmp_path: Path) -> None:
    force, bonds = found(tmp_path / "rest", script(LAWS[name], style, newton, 0.0), 1)
    assert np.count_nonzero(bonds[:, 5] == 0) == 0, "all bonds must have softened"
    assert len(bonds) == COUNT - 1
    once_around = 1.1 * BOX / (STEPS * STEP)
    for ranks in (1, 2):
        carried = found(tmp_path / f"{ranks}", script(LAWS[name], style, newton, once_around), ranks)
        # positions of 16 mm are rounded to 2e-18 m, times 3.7e8 N/m: 1e-9 N beside forces of some 10 N
        for mine, theirs in zip(carried, (force, bonds), strict=True):
            assert np.all(np.abs(mine - theirs) <= 1e-9 * np.abs(theirs).max(axis=0))
