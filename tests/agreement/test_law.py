"""One law, two codes: the headers that LAMMPS is compiled with against the laws in NumPy, over paths and histories."""

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

from pipeline.core.errors import InputError
from pipeline.lmp.law_table import Law, coefficients
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.softening import Softening

from .law_table import DN, DT, FN, FT, KN, KS, SHAPES, TABLE

CPP = Path(__file__).resolve().parents[2] / "pipeline" / "lmp" / "cpp"
SAME = 1e-12  # asked for: a handful of roundings of 1e-16 each, magnified by delta_max/delta_peak at most
COLUMNS = 7

Follow = Callable[[str, np.ndarray], np.ndarray]


class Refused(Exception):
    """What the C++ says."""


@pytest.fixture(scope="module")
def cpp(tmp_path_factory: pytest.TempPathFactory) -> Follow:
    """A law in C++ along a path (steps, 3): forces, stored, used up, delta_reached, damage, progress."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler: the package itself could not be built here")
    library = tmp_path_factory.mktemp("law") / "harness.so"
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


def python(law: Law, path: np.ndarray) -> np.ndarray:
    """A law in NumPy along a path, with the same columns."""
    if isinstance(law, CreepingSoftening):
        return np.array(list(_creeping(law, path)))
    if isinstance(law, MixedSoftening):
        return np.array(list(_mixed(law, path)))
    return np.array(list(_central(law, path)))


def _central(law, path):
    reached = np.zeros(1)
    for opening in path[:, :1]:
        force = law.force(opening, reached)
        reached = law.reached(opening, reached)
        # C++ notes openings only from the peak on: below it there is nothing to remember
        seen = np.where(reached > law.delta_peak, reached, 0.0)
        values = force, 0 * force, law.stored(opening, reached), law.dissipated(reached), seen, law.damage(reached)
        yield [*(float(v[0]) for v in values), 0.0]


def _mixed(law, path):
    state = law.at_rest()
    for opening, sliding in path[:, :2, None]:
        state = law.advance(state, opening, sliding)
        values = *law.forces(state, opening, sliding), law.stored(state, opening, sliding), state.used
        yield [float(v[0]) for v in (*values, law.reached(state), law.damage(state), state.progress)]


def _creeping(law, path):
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


@pytest.mark.parametrize("name", TABLE)
def test_the_table(name: str, cpp: Follow) -> None:
    law, path = TABLE[name]
    expected, found = python(law, path), cpp(coefficients(law, 0), path)
    apart = np.abs(found - expected) / scales(law, expected)
    # delta_reached is found from D where bonds slide: near the end of a tail it is known 1e-3 as well as D
    tolerance = np.full(COLUMNS, SAME)
    tolerance[4] = 1e-9 if isinstance(law, MixedSoftening) else SAME
    assert np.all(apart < tolerance), apart.max(axis=0)


@settings(max_examples=150, deadline=None)
@given(
    k_n=st.floats(1e3, 1e12),
    f_max=st.floats(1e-3, 1e6),
    end=st.floats(1.001, 1e4),
    shape=st.sampled_from(list(SHAPES.values())),
    unloading=st.sampled_from(["secant", "elastic"]),
    path=st.lists(st.floats(-5, 5), min_size=1, max_size=30),
)
def test_any_opening_on_any_path(k_n, f_max, end, shape, unloading, path, cpp: Follow) -> None:
    law = CentralSoftening(k_n, f_max, end * f_max / k_n, shape, unloading)
    steps = np.column_stack([law.delta_max * np.array(path), np.zeros((len(path), 2))])
    expected, found = python(law, steps), cpp(coefficients(law, 0), steps)
    assert np.all(np.abs(found - expected) / scales(law, expected) < SAME * max(1, 1e-3 * end))  # as said at SAME


@settings(max_examples=150, deadline=None)
@given(
    stiffness=st.floats(0.05, 2),
    strength=st.floats(0.1, 3),
    shape=st.sampled_from(list(SHAPES.values())),
    unloading=st.sampled_from(["secant", "elastic"]),
    friction=st.sampled_from([0.0, 0.4]),
    path=st.lists(st.tuples(st.floats(-2, 5), st.floats(-5, 5)), min_size=1, max_size=20),
)
def test_any_sliding_on_any_path(stiffness, strength, shape, unloading, friction, path, cpp: Follow) -> None:
    law = MixedSoftening(KN, stiffness * KN, FN, strength * FN, DN, DT, shape, unloading, friction)
    steps = np.column_stack([DN * np.array(path).reshape(-1, 2), np.zeros(len(path))])
    expected, found = python(law, steps), cpp(coefficients(law, 0), steps)
    apart = np.abs(found - expected) / scales(law, expected)
    # whether a bond that just reaches a limit passes it is a matter of the last bit, and so is what follows: 1e-10
    assert np.all(np.delete(apart, 4, axis=1) < 1e-10)


REFUSED = [
    (lambda: LinearSoftening(-1.0, FN, DN), f"-1 {FN} {DN}"),
    (lambda: LinearSoftening(np.inf, FN, DN), f"inf {FN} {DN}"),
    (lambda: LinearSoftening(KN, 0.0, DN), f"{KN} 0 {DN}"),
    (lambda: LinearSoftening(KN, FN, -1e-6), f"{KN} {FN} -1e-6"),
    (lambda: LinearSoftening(KN, FN, 1e-7), f"{KN} {FN} 1e-7"),
    (lambda: MixedSoftening(KN, 0.0, FN, FT, DN, DT), f"{KN} {FN} {DN} shear 0 {FT} {DT}"),
    (lambda: MixedSoftening(KN, -3.0, FN, FT, DN, DT), f"{KN} {FN} {DN} shear -3 {FT} {DT}"),
    (lambda: MixedSoftening(KN, KS, FN, np.inf, DN, DT), f"{KN} {FN} {DN} shear {KS} inf {DT}"),
    (lambda: MixedSoftening(KN, KS, FN, FT, DN, 0.0), f"{KN} {FN} {DN} shear {KS} {FT} 0"),
    (lambda: MixedSoftening(KN, KS, FN, FT, DN, 1e-8), f"{KN} {FN} {DN} shear {KS} {FT} 1e-8"),
    (
        lambda: MixedSoftening(KN, KS, FN, FT, DN, DT, friction=-0.5),
        f"{KN} {FN} {DN} shear {KS} {FT} {DT} friction -0.5",
    ),
    (lambda: Softening("bilinear-tail", 1.5), f"{KN} {FN} {DN} softening bilinear-tail 1.5"),
    (lambda: Softening("sudden"), f"{KN} {FN} {DN} softening sudden"),
    (lambda: CentralSoftening(KN, FN, DN, unloading="plastic"), f"{KN} {FN} {DN} unloading plastic"),
]


@pytest.mark.parametrize(("make", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_both_refuse_in_the_same_sentence(make: Callable[[], object], words: str, cpp: Follow) -> None:
    with pytest.raises(InputError) as told:
        make()
    with pytest.raises(Refused) as also:
        cpp(words, np.zeros((1, 3)))
    assert str(also.value) == str(told.value)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("1e8", "takes a type, k_n, f_max and delta_max: f_max is missing"),
        ("1e8 71 strong", "delta_max = strong must be a number"),
        ("1e8 71 1e-4 creep", "does not know 'creep'"),
        ("1e8 71 1e-4 friction 0.3", "friction = 0.3 needs bonds that slide"),
        ("1e8 71 1e-4 relax 9", "relax takes 1 to 4 arms"),
        ("1e8 71 1e-4 relax 1 1.5 3", "sum of shares = 1.5 of the arms must be at most 1"),
        ("1e8 71 1e-4 relax 1 0.5 0", "time = 0 s of an arm must be finite and positive"),
        ("1e8 71 1e-4 relax 1 0.5 1 shear 1e7 50 1e-4", "bonds that relax cannot have a shear stiffness"),
    ],
)
def test_words_that_are_no_law(words: str, sentence: str, cpp: Follow) -> None:
    with pytest.raises(Refused) as told:
        cpp(words, np.zeros((1, 3)))
    assert sentence in str(told.value)
