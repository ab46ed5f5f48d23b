"""One law, two codes: the header that LAMMPS is compiled with against the law in NumPy, over openings and histories."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.materials.cohesive import LinearSoftening

CPP = Path(__file__).resolve().parents[2] / "pipeline" / "lmp" / "cpp"
SAME = 1e-12  # asked for: a handful of roundings of 1e-16 each, magnified nowhere

Follow = Callable[[LinearSoftening, np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def cpp(tmp_path_factory: pytest.TempPathFactory) -> Follow:
    """The law in C++ along a path: rows force (N), delta_reached (m), stored, dissipated (J), damage."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler: the package itself could not be built here")
    library = tmp_path_factory.mktemp("law") / "harness.so"
    source = Path(__file__).with_name("law_harness.cpp")
    # contraction and vectors as in the package: the agreement must not hang on them
    flags = ["-std=c++17", "-O3", "-march=native", "-fPIC", "-shared", f"-I{CPP}"]
    subprocess.run([compiler, *flags, str(source), "-o", str(library)], check=True)
    code = ctypes.CDLL(str(library))
    pointer = ctypes.POINTER(ctypes.c_double)
    code.follow.argtypes = [pointer, ctypes.c_int, pointer, pointer]

    def follow(law: LinearSoftening, openings: np.ndarray) -> np.ndarray:
        rows = np.zeros((openings.size, 5))
        three = np.array([law.k_n[0], law.f_max[0], law.delta_max[0]])
        path = np.ascontiguousarray(openings, float)
        code.follow(
            *(a.ctypes.data_as(pointer) if isinstance(a, np.ndarray) else a for a in (three, path.size, path)),
            rows.ctypes.data_as(pointer),
        )
        return rows

    return follow


def python(law: LinearSoftening, openings: np.ndarray) -> np.ndarray:
    """The law in NumPy along a path, with the same columns."""
    reached, rows = np.zeros(1), []
    for opening in np.asarray(openings, float)[:, None]:
        force = law.force(opening, reached)
        reached = law.reached(opening, reached)
        rows.append([force, reached, law.stored(opening, reached), law.dissipated(reached), law.damage(reached)])
    return np.array(rows)[:, :, 0]


def compare(law: LinearSoftening, openings: np.ndarray, cpp: Follow) -> None:
    """Every column to 1e-12 of what is natural for it or, in deep compression, of its largest value."""
    expected, found = python(law, openings), cpp(law, openings)
    elastic = expected[:, 1] <= law.delta_peak[0]
    assert np.all(found[elastic, 1] == 0), "nothing to remember before the peak"
    expected[elastic, 1] = 0
    f_max, delta_max = law.f_max[0], law.delta_max[0]
    natural = [f_max, delta_max, f_max * delta_max / 2, f_max * delta_max / 2, 1.0]
    scale = np.maximum(natural, np.abs(expected).max(axis=0))
    assert (found - expected) / scale == pytest.approx(np.zeros_like(found), abs=SAME)


@pytest.mark.parametrize("end", [1.01, 2.0, 40.0, 600.0], ids=lambda ratio: f"delta_max {ratio:g} delta_peak")
def test_up_and_down_from_every_history(end: float, cpp: Follow) -> None:
    """A lattice of largest openings, each followed by every other opening: forward, back, into compression."""
    law = LinearSoftening(np.array([3.7e8]), np.array([71.0]), np.array([end * 71.0 / 3.7e8]))
    marks = np.unique(np.concatenate([np.linspace(-3, 1.2 * end, 40), [0, 1, end, 1 - 1e-9, 1 + 1e-9]]))
    for largest in marks[marks > 0]:
        for opening in marks:
            compare(law, np.array([largest, opening, -largest, largest]) * law.delta_peak[0], cpp)


@settings(max_examples=200, deadline=None)
@given(
    k_n=st.floats(1e3, 1e12),
    f_max=st.floats(1e-3, 1e6),
    end=st.floats(1.001, 1e5),
    path=st.lists(st.floats(-5, 1.5), min_size=1, max_size=30),
)
def test_any_law_on_any_path(k_n: float, f_max: float, end: float, path: list[float], cpp: Follow) -> None:
    delta_max = end * f_max / k_n
    compare(LinearSoftening(np.array([k_n]), np.array([f_max]), np.array([delta_max])), delta_max * np.array(path), cpp)


def test_a_bond_without_damage(cpp: Follow) -> None:
    law = LinearSoftening(np.array([1e8]), np.array([np.inf]), np.array([np.inf]))
    rows = cpp(law, np.array([1e-3, -1e-3, 5e-4]))
    assert rows[:, 0] == pytest.approx([1e5, -1e5, 5e4], rel=SAME)
    assert np.all(rows[:, [1, 3, 4]] == 0)
