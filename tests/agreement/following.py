"""One bond along a path, by the laws in NumPy and by the headers that LAMMPS is compiled with."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from pipeline.lmp.law_table import Law
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening

from .law_table import KN

CPP = Path(__file__).resolve().parents[2] / "pipeline" / "lmp" / "cpp"
COLUMNS = 7  # forces along and across, stored, used up, delta_reached, damage, progress

Follow = Callable[[str, np.ndarray], np.ndarray]


class Refused(Exception):
    """What the C++ says."""


def python(law: Law, path: np.ndarray) -> np.ndarray:
    """A law in NumPy along a path of openings, slidings and durations (steps, 3): rows (steps, 7)."""
    if isinstance(law, CreepingSoftening):
        return np.array(list(_creeping(law, path)))
    if isinstance(law, MixedSoftening):
        return np.array(list(_mixed(law, path)))
    return np.array(list(_central(law, path)))


def _central(law: CentralSoftening, path: np.ndarray) -> Iterator[list[float]]:
    reached = np.zeros(1)
    for opening in path[:, :1]:
        force = law.force(opening, reached)
        reached = law.reached(opening, reached)
        # C++ notes openings only from the peak on: below it there is nothing to remember
        seen = np.where(reached > law.delta_peak, reached, 0.0)
        values = force, 0 * force, law.stored(opening, reached), law.dissipated(reached), seen, law.damage(reached)
        yield [*(float(v[0]) for v in values), 0.0]


def _mixed(law: MixedSoftening, path: np.ndarray) -> Iterator[list[float]]:
    state = law.at_rest()
    for opening, sliding in path[:, :2, None]:
        state = law.advance(state, opening, sliding)
        values = *law.forces(state, opening, sliding), law.stored(state, opening, sliding), state.used
        yield [float(v[0]) for v in (*values, law.reached(state), law.damage(state), state.progress)]


def _creeping(law: CreepingSoftening, path: np.ndarray) -> Iterator[list[float]]:
    state, used = law.at_rest(), 0.0
    for opening, _, duration in path:
        at = np.array([opening])
        after = law.advance(state, at, duration)
        used += float(law.used(state, after, duration)[0])
        force = law.force(after, at, 0.0)
        seen = law.equivalent(after)
        damage = law.without_creep.damage(seen)
        yield [float(force[0]), 0.0, float(law.stored(after)[0]), used, float(seen[0]), float(damage[0]), 0.0]
        state = after


def scales(law: Law, expected: np.ndarray) -> np.ndarray:
    """What is natural for each column or, in deep compression, its largest value."""
    finite = np.isfinite(law.f_max[0])
    f_max, delta = (law.f_max[0], law.delta_max[0]) if finite else (KN * 1e-6, 1e-6)
    if isinstance(law, MixedSoftening) and finite:
        f_max, delta = max(f_max, law.f_shear[0]), max(delta, law.delta_shear[0])
    natural = [f_max, f_max, f_max * delta / 2, f_max * delta / 2, delta, 1.0, 1.0]
    return np.maximum(natural, np.abs(expected).max(axis=0))


def compiled(folder: Path) -> Follow:
    """A law in C++, from the words of its coefficients, along a path (steps, 3): the columns of `python`."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler: the package itself could not be built here")
    library = folder / "harness.so"
    sources = [Path(__file__).with_name("law_harness.cpp"), CPP / "cohesive_coeff.cpp"]
    # vectors as in the package: the agreement must not hang on them
    flags = ["-std=c++17", "-O2", "-march=native", "-ffp-contract=off", "-fPIC", "-shared", f"-I{CPP}"]
    subprocess.run([compiler, *flags, *map(str, sources), "-o", str(library)], check=True)
    code = ctypes.CDLL(str(library))
    pointer = ctypes.POINTER(ctypes.c_double)
    code.follow.argtypes = [ctypes.c_char_p, ctypes.c_int, pointer, pointer, ctypes.c_char_p, ctypes.c_int]

    def follow(words: str, path: np.ndarray) -> np.ndarray:
        rows, told = np.zeros((len(path), COLUMNS)), ctypes.create_string_buffer(1000)
        steps = np.ascontiguousarray(path, float)
        values = (steps.ctypes.data_as(pointer), rows.ctypes.data_as(pointer))
        if code.follow(words.encode(), len(steps), *values, told, 1000):
            raise Refused(told.value.decode())
        assert told.value.decode().split() == words.split(), "what is read is written again, word by word"
        return rows

    return follow
