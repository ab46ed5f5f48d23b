"""Bond types: the distinct rows of a problem's bond properties."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import UnavailableError
from pipeline.core.particles import Phase
from pipeline.core.problem import Problem
from pipeline.materials.cohesive import LinearSoftening


@dataclass(frozen=True)
class LawTable:
    """Rows k_n (N/m), f_max (N; inf takes no damage), delta_max (m), and each bond's row.

    Parameters
    ----------
    rows : (types, 3) array
    type : (m,) int array, 0-based
    name : (types,) list of str; the phases that use a row
    """

    rows: np.ndarray
    type: np.ndarray
    name: list[str]


def law_table(problem: Problem) -> LawTable:
    """Collect the distinct bond properties of a problem."""
    law = problem.law
    if not isinstance(law, LinearSoftening):
        raise UnavailableError(f"the LAMMPS engine does not follow {type(law).__name__} in this version")
    elastic = np.isinf(law.f_max)
    delta_max = np.where(elastic, np.inf, law.delta_max)
    rows, index = np.unique(np.column_stack([law.k_n, law.f_max, delta_max]), axis=0, return_inverse=True)
    index = index.reshape(-1)
    return LawTable(rows, index, [_name(problem.bonds.phase[index == k]) for k in range(len(rows))])


def _name(phases: np.ndarray) -> str:
    return "+".join(Phase(p).name.lower() for p in np.unique(phases))
