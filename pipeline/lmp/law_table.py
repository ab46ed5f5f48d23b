"""Bond types: the distinct rows of a problem's bond properties, as coefficients of bond_style cohesive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import UnavailableError
from pipeline.core.particles import Phase
from pipeline.core.problem import BondLaw, Problem
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.softening import Shape, Softening, Unloading

Law = CentralSoftening | MixedSoftening | CreepingSoftening
MOST_ARMS = 4  # of cohesive_law.h


@dataclass(frozen=True)
class LawTable:
    """One line of coefficients a bond type, and each bond's type.

    Parameters
    ----------
    rows : (types, 3) array; k_n (N/m), f_max (N; inf takes no damage), delta_max (m)
    coefficients : (types,) list of str; what follows `bond_coeff TYPE`
    type : (m,) int array, 0-based
    name : (types,) list of str; the phases that use a row
    """

    rows: np.ndarray
    coefficients: list[str]
    type: np.ndarray
    name: list[str]


def law_table(problem: Problem) -> LawTable:
    """Collect the distinct bond properties of a problem."""
    law = supported(problem.law)
    rows, first, index = np.unique(_numbers(law), axis=0, return_index=True, return_inverse=True)
    index = index.reshape(-1)
    names = [_name(problem.bonds.phase[index == k]) for k in range(len(rows))]
    return LawTable(rows[:, :3], [coefficients(law, int(k)) for k in first], index, names)


def supported(law: BondLaw) -> Law:
    """The law, where bond_style cohesive knows it.

    Raises
    ------
    UnavailableError
        for a law that it does not
    """
    if not isinstance(law, Law):
        raise UnavailableError(f"bond_style cohesive does not know the law {type(law).__name__}")
    if isinstance(law, CreepingSoftening) and law.rise.time.shape[1] > MOST_ARMS:
        raise UnavailableError(f"bond_style cohesive takes up to {MOST_ARMS} arms a bond, not {law.rise.time.shape[1]}")
    return law


def coefficients(law: Law, bond: int) -> str:
    """K_N F_MAX DELTA_MAX and the options of one bond, 17 digits."""
    words = [_exact(law.k_n[bond]), *_strength(law.f_max[bond], law.delta_max[bond])]
    if isinstance(law, MixedSoftening):
        shear = _strength(law.f_shear[bond] if np.isfinite(law.f_max[bond]) else np.inf, law.delta_shear[bond])
        words += ["shear", _exact(law.k_s[bond]), *shear]
    if np.isfinite(law.f_max[bond]):
        words += _options(law.softening, law.unloading)
        words += ["friction", _exact(law.friction)] if isinstance(law, MixedSoftening) and law.friction else []
    return " ".join(words + (_arms(law, bond) if isinstance(law, CreepingSoftening) else []))


def _numbers(law: Law) -> np.ndarray:
    """Everything that bonds may differ in, a row a bond."""
    columns = [law.k_n, law.f_max, np.where(np.isinf(law.f_max), np.inf, law.delta_max)]
    if isinstance(law, MixedSoftening):
        columns += [law.k_s, *(np.where(np.isinf(law.f_max), np.inf, v) for v in (law.f_shear, law.delta_shear))]
    if isinstance(law, CreepingSoftening):
        columns += [*law.rise.stiffness.T, *np.where(law.rise.stiffness > 0, law.rise.time, 1.0).T]
    return np.column_stack(columns)


def _strength(force: float, opening: float) -> list[str]:
    return [_exact(force), _exact(opening if np.isfinite(force) else np.inf)]


def _options(softening: Softening, unloading: Unloading) -> list[str]:
    words = [] if softening.shape is Shape.LINEAR else ["softening", softening.shape.value]
    words += [_exact(softening.tail)] if softening.shape is Shape.BILINEAR_TAIL else []
    return words + ([] if unloading is Unloading.SECANT else ["unloading", unloading.value])


def _arms(law: CreepingSoftening, bond: int) -> list[str]:
    stiffness, time = law.rise.stiffness[bond], law.rise.time[bond]
    pairs = [(k / law.k_n[bond], t) for k, t in zip(stiffness, time, strict=True) if k > 0]
    return ["relax", str(len(pairs)), *(_exact(v) for pair in pairs for v in pair)] if pairs else []


def _exact(value: float) -> str:
    return f"{value:.17g}"


def _name(phases: np.ndarray) -> str:
    return "+".join(Phase(p).name.lower() for p in np.unique(phases))
