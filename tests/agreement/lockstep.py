"""LAMMPS one step at a time, beside the NumPy engine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.problem import BondLaw, Problem
from pipeline.explicit.modes import shear_stiffness
from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.plugin import open_lammps
from pipeline.materials.creeping_softening import BondState, CreepingSoftening
from pipeline.materials.memory import CentralMemory, CreepingMemory, Memory, MixedMemory, at_rest
from pipeline.materials.mixed_softening import MixedSoftening, MixedState

GLOBAL, LOCAL = 0, 2  # styles of fixes and computes in the LAMMPS library
VECTOR, ARRAY = 1, 2  # types
RATE, LAG, TIME = 10, 14, 15  # places in the vector of fix cohesive/drive
SINGLE, HISTORY = 7, 10  # columns of compute bond/local: what a reader wants, and the history itself


@dataclass(frozen=True)
class Snapshot:
    """What LAMMPS has after a step.

    Positions (n, 2), m; velocities (n, 2), m per step; forces (n, 2), N; angles, spins, torques (n,), rad, rad per
    step, N m; the bonds' columns of compute bond/local (m, 17); speed of the machine, m per step, lag, time, s.
    """

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    angle: np.ndarray
    spin: np.ndarray
    torque: np.ndarray
    bonds: np.ndarray
    rate: float
    lag: float
    time: float

    @property
    def reached(self) -> np.ndarray:
        """Largest opening (m,), m, of every bond, or its like."""
        return self.bonds[:, 1]

    def memory(self, law: BondLaw) -> Memory:
        """What the bonds remember, as the NumPy engine keeps it."""
        opening, sliding, kept = self.bonds[:, 0], self.bonds[:, 4], self.bonds[:, SINGLE:]
        if isinstance(law, MixedSoftening):
            return MixedMemory(law, opening, sliding, MixedState(kept[:, 0], kept[:, 3:5], kept[:, 5]))
        if isinstance(law, CreepingSoftening):
            onset = np.where(kept[:, 3] == 0, np.inf, kept[:, 3])
            arms = kept[:, 6 : 6 + law.rise.time.shape[1]]
            return CreepingMemory(law, BondState(opening, arms, onset, kept[:, 0]), kept[:, 5])
        memory = at_rest(law)
        assert isinstance(memory, CentralMemory)
        return CentralMemory(memory.law, opening, kept[:, 0])


def lammps_steps(problem: Problem, folder: Path) -> Iterator[Snapshot]:
    """What LAMMPS has after each step of the deck of a problem, until the gauge reads cmod_max."""
    write_deck(folder, problem)
    setup, _, _ = (folder / DECK).read_text().partition("fix             curve")
    columns = " ".join(f"b{k}" for k in range(1, SINGLE + HISTORY + 1))
    (folder / "setup.lmp").write_text(
        setup + f"compute pairs all property/local batom1 batom2\ncompute bonds all bond/local {columns}\n"
    )
    home, lmp = Path.cwd(), open_lammps()
    try:
        os.chdir(folder)
        lmp.file("setup.lmp")
        os.chdir(home)
        lmp.command("run 0 post no")
        order = np.argsort(lmp.numpy.extract_atom("id")[: problem.particles.count])
        ends = np.sort(lmp.numpy.extract_compute("pairs", LOCAL, ARRAY).astype(int) - 1, axis=1)
        place = np.lexsort(ends.T[::-1])[np.argsort(np.lexsort(np.sort(problem.bonds.pairs, axis=1).T[::-1]))]
        names = [f"d_cohesive_{name}" for name in ("theta", "omega", "torque")]
        none = np.zeros(problem.particles.count)
        while True:
            lmp.command("run 1 pre no post no")
            turned = (
                [none] * 3 if shear_stiffness(problem) is None else [lmp.numpy.extract_atom(n)[order] for n in names]
            )
            yield Snapshot(
                *(lmp.numpy.extract_atom(name)[order, :2] for name in ("x", "v", "f")),
                *turned,
                lmp.numpy.extract_compute("bonds", LOCAL, ARRAY)[place],
                *(lmp.extract_fix("drive", GLOBAL, VECTOR, k) for k in (RATE, LAG, TIME)),
            )
    finally:
        os.chdir(home)
        lmp.close()
