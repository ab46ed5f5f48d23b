"""One law, two codes: the headers that LAMMPS is compiled with against the laws in NumPy, over paths and histories."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.lmp.law_table import coefficients
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.softening import Softening

from .following import COLUMNS, Follow, Refused, python, scales
from .law_table import DN, DT, FN, FT, KN, KS, SHAPES, TABLE, creeping

SAME = 1e-12  # asked for: a handful of roundings of 1e-16 each, magnified by delta_max/delta_peak at most


@pytest.mark.parametrize("name", TABLE)
def test_the_table(name: str, cpp: Follow) -> None:
    law, path = TABLE[name]
    expected, found = python(law, path), cpp(coefficients(law, 0), path)
    apart = np.abs(found - expected) / scales(law, expected)
    # delta_reached is found from D where bonds slide: near the end of a tail it is known 1e-3 as well as D
    tolerance = np.full(COLUMNS, SAME)
    tolerance[4] = 1e-9 if isinstance(law, MixedSoftening) else SAME
    assert np.all(apart < tolerance), apart.max(axis=0)


@settings(max_examples=150)
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


@settings(max_examples=150)
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
    (lambda: MixedSoftening(KN, KS, np.inf, FT, DN, DT), f"{KN} inf {DN} shear {KS} {FT} {DT}"),
    (lambda: replace(creeping(), f_max=np.zeros(1)), f"{KN} 0 {DN} relax 1 1 5"),
    (lambda: replace(creeping(), delta_max=np.array([np.inf])), f"{KN} {FN} inf relax 1 1 5"),
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
        ("1e8 71 1e-4 relax 9", "relax = 9 must be a whole number of arms, 1 to 4"),
        ("1e8 71 1e-4 relax 0", "relax = 0 must be a whole number of arms, 1 to 4"),
        ("1e8 71 1e-4 relax 1.5", "relax = 1.5 must be a whole number of arms, 1 to 4"),
        ("1e8 71 1e-4 relax", "number of arms of relax is missing"),
        ("1e8 71 1e-4 shear", "k_s is missing"),
        ("1e8 71 1e-4 relax 1 1.5 3", "sum of shares = 1.5 of the arms must be at most 1"),
        ("1e8 71 1e-4 relax 1 0.5 0", "time = 0 s of an arm must be finite and positive"),
        ("1e8 71 1e-4 relax 1 0.5 1 shear 1e7 50 1e-4", "bonds that relax cannot have a shear stiffness"),
    ],
)
def test_words_that_are_no_law(words: str, sentence: str, cpp: Follow) -> None:
    with pytest.raises(Refused) as told:
        cpp(words, np.zeros((1, 3)))
    assert sentence in str(told.value)
