"""LAMMPS one step at a time, beside the NumPy engine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.problem import Problem
from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.plugin import open_lammps

GLOBAL, LOCAL = 0, 2  # styles of fixes and computes in the LAMMPS library
VECTOR, ARRAY = 1, 2  # types
RATE, LAG = 10, 14  # places in the vector of fix cohesive/drive


@dataclass(frozen=True)
class Snapshot:
    """What LAMMPS has after a step.

    Positions (n, 2), m; velocities (n, 2), m per step; forces (n, 2), N; largest openings (m,), m; speed of
    the machine, m per step, and lag.
    """

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    reached: np.ndarray
    rate: float
    lag: float


def lammps_steps(problem: Problem, folder: Path) -> Iterator[Snapshot]:
    """What LAMMPS has after each step of the deck of a problem, until the gauge reads cmod_max."""
    write_deck(folder, problem)
    setup, _, _ = (folder / DECK).read_text().partition("fix             curve")
    (folder / "setup.lmp").write_text(
        setup + "compute pairs all property/local batom1 batom2\ncompute bonds all bond/local b2\n"
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
        while True:
            lmp.command("run 1 pre no post no")
            yield Snapshot(
                *(lmp.numpy.extract_atom(name)[order, :2] for name in ("x", "v", "f")),
                reached=lmp.numpy.extract_compute("bonds", LOCAL, VECTOR)[place].reshape(-1),
                rate=lmp.extract_fix("drive", GLOBAL, VECTOR, RATE),
                lag=lmp.extract_fix("drive", GLOBAL, VECTOR, LAG),
            )
    finally:
        os.chdir(home)
        lmp.close()
