"""One bond in LAMMPS against the law in Python: the two codes of one law."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.errors import InputError
from pipeline.lmp.plugin import open_lammps
from pipeline.materials.cohesive import LinearSoftening

LENGTH = 6e-4
K_N, F_MAX, DELTA_MAX = 3.7e8, 71.0, 1.14e-4
PEAK = F_MAX / K_N
# up, back, into compression, farther, past failure, compressed after failure, and open again
PATH = np.array([0.4, 1.01, 3.0, 1.5, -2.0, 2.0, 100.0, 30.0, 400.0, 700.0, -5.0, 50.0, 0.0]) * PEAK
SMALL = "kinematics small"
FINITE = "kinematics finite"


@contextmanager
def one_bond(angle: float = 0.0, style: str = SMALL, coefficients: str | None = None) -> Iterator[Any]:
    """Two particles joined by an unstretched bond in direction `angle` (rad)."""
    lmp = open_lammps()
    try:
        lmp.commands_string(f"""
units si
dimension 2
boundary f f p
atom_style bond
atom_modify map array
region box block -0.01 0.01 -0.01 0.01 -0.001 0.001
create_box 1 box bond/types 1 extra/bond/per/atom 1 extra/special/per/atom 1
create_atoms 1 single 0 0 0
create_atoms 1 single {LENGTH * np.cos(angle):.17g} {LENGTH * np.sin(angle):.17g} 0
mass 1 1.0
pair_style none
comm_modify cutoff 0.002
neighbor 0.0005 bin
bond_style cohesive {style}
bond_coeff 1 {coefficients or f"{K_N} {F_MAX} {DELTA_MAX}"}
create_bonds single/bond 1 1 2
compute bond all bond/local force engpot b1 b2 b3 b4
thermo_style custom step pe
run 0 post no
""")
        yield lmp
    finally:
        lmp.close()


def move(lmp: Any, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Put the second particle at `place` (2,) from the first; forces on both, (2, 2)."""
    lmp.numpy.extract_atom("x")[1, :2] = place
    lmp.command("run 0 post no")
    force = lmp.numpy.extract_atom("f")[:2, :2].copy()
    return force[0], force[1]


def local(lmp: Any) -> np.ndarray:
    """The bond's row of compute bond/local: force, energy, opening, delta_reached, damage, tension."""
    lmp.command("run 0 post no")
    return lmp.numpy.extract_compute("bond", 2, 2)[0].copy()


def python_path(openings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and largest opening along a path, by the law in NumPy."""
    law = LinearSoftening(np.array([K_N]), np.array([F_MAX]), np.array([DELTA_MAX]))
    reached = np.zeros(1)
    forces, history = [], []
    for opening in openings:
        forces.append(law.force(np.array([opening]), reached)[0])
        reached = law.reached(np.array([opening]), reached)
        history.append(reached[0])
    return np.array(forces), np.array(history)


@pytest.mark.parametrize("style", [SMALL, FINITE])
@pytest.mark.parametrize("angle", [0.0, np.pi / 2, 0.7])
def test_force_and_history_are_those_of_python(style: str, angle: float) -> None:
    direction = np.array([np.cos(angle), np.sin(angle)])
    expected, reached = python_path(PATH)
    with one_bond(angle, style) as lmp:
        start = lmp.numpy.extract_atom("x")[1, :2].copy()
        for opening, force, largest in zip(PATH, expected, reached, strict=True):
            on_first, on_second = move(lmp, start + opening * direction)
            # openings are differences of positions of 6e-4 m: their round-off is 1e-12 of delta_peak
            assert on_first == pytest.approx(force * direction, abs=1e-11 * F_MAX)
            assert (on_first == -on_second).all(), "F1 = -F2, to the last bit"
            # LAMMPS notes openings only from delta_peak on: below it there is nothing to remember
            assert local(lmp)[3] == pytest.approx(largest if largest > PEAK else 0, abs=1e-11 * PEAK)  # as above


@settings(max_examples=15)
@given(st.lists(st.floats(-3, 700), min_size=1, max_size=12))
def test_any_path_agrees_with_python(path: list[float]) -> None:
    openings = np.array(path) * PEAK
    expected, _ = python_path(openings)
    with one_bond() as lmp:
        forces = [move(lmp, np.array([LENGTH + opening, 0.0]))[0][0] for opening in openings]
    assert np.array(forces) == pytest.approx(expected, abs=1e-11 * F_MAX)  # round-off of positions, as above


def test_area_under_the_law_is_half_f_max_delta_max() -> None:
    openings = np.linspace(0, 1.1 * DELTA_MAX, 4001)
    with one_bond() as lmp:
        force = [move(lmp, np.array([LENGTH + opening, 0.0]))[0][0] for opening in openings]
    # trapezoid over two kinks: at most a step (2.8e-4 of delta_max) wide, f_max/2 high
    assert np.trapezoid(force, openings) == pytest.approx(F_MAX * DELTA_MAX / 2, rel=6e-4)


def test_energy_and_damage_of_compute_bond_local() -> None:
    law = LinearSoftening(np.array([K_N]), np.array([F_MAX]), np.array([DELTA_MAX]))
    opening, largest = 20 * PEAK, 50 * PEAK
    with one_bond() as lmp:
        move(lmp, np.array([LENGTH + largest, 0.0]))
        move(lmp, np.array([LENGTH + opening, 0.0]))
        row = local(lmp)
        assert lmp.get_thermo("pe") == pytest.approx(row[1], rel=1e-14)  # the same number by two ways
    at, seen = np.array([opening]), np.array([largest])
    tolerance = 1e-11  # round-off of positions
    assert row[1] == pytest.approx(law.stored(at, seen)[0], rel=tolerance)
    assert row[4] == pytest.approx(law.damage(seen)[0], rel=tolerance)
    assert row[5] == pytest.approx(law.force(at, seen)[0], rel=tolerance)
    assert row[0] == pytest.approx(-row[5], rel=tolerance), "LAMMPS counts bond forces positive when repulsive"


def test_finite_kinematics_feels_no_rigid_rotation() -> None:
    with one_bond(0.3, FINITE) as lmp:
        turned = LENGTH * np.array([np.cos(0.4), np.sin(0.4)])
        force, _ = move(lmp, turned)
    assert np.abs(force).max() < 1e-8 * F_MAX  # asked for; round-off of positions is far below


def test_small_kinematics_keeps_its_reference_direction() -> None:
    with one_bond(0.0, SMALL) as lmp:
        force, _ = move(lmp, np.array([LENGTH, 1e-4]))
    assert np.abs(force).max() < 1e-11 * F_MAX  # sliding opens nothing: round-off of positions


def test_elastic_bond_takes_no_damage() -> None:
    with one_bond(coefficients=f"{K_N} inf inf") as lmp:
        force, _ = move(lmp, np.array([LENGTH + 100 * PEAK, 0.0]))
        assert force[0] == pytest.approx(100 * F_MAX, rel=1e-12)  # round-off of positions
        assert local(lmp)[4] == 0


@pytest.mark.parametrize(
    ("k_n", "f_max", "delta_max"),
    [(-1.0, 71.0, 1e-4), (3.7e8, -71.0, 1e-4), (3.7e8, 71.0, 1e-7), (3.7e8, 0.0, 1e-4)],
)
def test_refusals_are_the_sentences_of_python(k_n: float, f_max: float, delta_max: float) -> None:
    with pytest.raises(InputError) as python:
        LinearSoftening(np.array([k_n]), np.array([f_max]), np.array([delta_max]))
    with pytest.raises(Exception, match="ERROR") as lammps, one_bond(coefficients=f"{k_n:g} {f_max:g} {delta_max:g}"):
        pass
    assert str(python.value) in str(lammps.value)


@pytest.mark.parametrize("coefficients", ["1e8", "1e8 71", "1e8 plastic", "1e8 71 inf", "inf 71 1e-4", "1e8 nan 1e-4"])
def test_malformed_coefficients_are_refused(coefficients: str) -> None:
    with pytest.raises(Exception, match="ERROR"), one_bond(coefficients=coefficients):
        pass


def test_unknown_kinematics_is_refused() -> None:
    with (
        pytest.raises(Exception, match="kinematics = large must be small or finite"),
        one_bond(style="kinematics large"),
    ):
        pass
