"""Bonds that open and slide in equilibria: one bond, two blocks, specimens through failure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import Gauge, Grip, Kinematics, Problem, Role
from pipeline.core.units import MM
from pipeline.equilibrium.model import State, rest, whole_model
from pipeline.equilibrium.potential import Potential
from pipeline.equilibrium.solve import solve
from pipeline.equilibrium.step import Stepper
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.softening import LINEAR, Shape, Softening, Unloading

from .specimens import BEAM, fracture_test

RADIUS, KN, KS, FN, FT, DN, DT = 0.5 * MM, 4e8, 1e8, 80.0, 50.0, 1e-5, 2e-5
SHEAR = {"poissons_ratio": 0.2, "shear_strength_ratio": 0.7, "shear_opening_ratio": 1.2}


def law(bonds: int = 1, **options) -> MixedSoftening:
    """The same mixed law in every bond."""
    return MixedSoftening(np.full(bonds, KN), KS, FN, FT, DN, DT, **options)


def one_bond(turn: float, kinematics: Kinematics, **options) -> Problem:
    """Two particles and a bond at the angle `turn`; grips hold the first, and the second's x follows the machine."""
    position = 2 * RADIUS * np.array([[0.0, 0.0], [np.cos(turn), np.sin(turn)]])
    particles = Particles(position, RADIUS, np.full(2, Phase.MASTIC, np.uint8), np.zeros(2, np.int32))
    bonds = Bonds(np.array([[0, 1]], np.int32), np.full(1, Phase.MASTIC, np.uint8), np.zeros(1, bool))
    grips = (
        _grip("x", [0], (1.0, 0.0), 0.0, Role.REACT),
        _grip("y", [0], (0.0, 1.0), 0.0, Role.GUIDE),
        _grip("pull", [1], (1.0, 0.0), 1.0, Role.DRIVE),
    )
    gauge = Gauge(np.array([1, 0]), np.array([1.0, -1.0]))
    return Problem(BEAM, particles, bonds, law(**options), grips, gauge, kinematics, 1e-5, np.array([5e-6]))


def _grip(name: str, index, direction: tuple[float, float], drive: float, role: Role) -> Grip:
    return Grip(name, np.array(index), np.full(len(index), 1 / len(index)), np.array(direction), drive, role)


def forces_of_one_bond(problem: Problem, path: np.ndarray) -> np.ndarray:
    """Tension, shear and couple over radius (steps, 3), N, on the second particle along openings and slidings, m."""
    model, found = whole_model(problem), []
    memory = rest(model).memory
    _, [direction] = problem.bonds.reference(problem.particles.position)
    across = np.array([-direction[1], direction[0]])
    for opening, sliding in path:
        turn = sliding / (2 * RADIUS) if problem.kinematics is Kinematics.FINITE else 0.0
        along = np.cos(turn) * direction + np.sin(turn) * across  # finite: the bond itself has turned
        sideways = np.cos(turn) * across - np.sin(turn) * direction
        if problem.kinematics is Kinematics.FINITE:
            moved = (2 * RADIUS + opening) * along - 2 * RADIUS * direction
        else:
            moved = opening * direction + sliding * across
        free = model.constraints.restrict(np.array([[0.0, 0.0, 0.0], [*moved, 0.0]]))
        potential = Potential(model.network, memory)
        gradient, load, deformation = potential.state(free, moved[0])
        internal = model.constraints.restrict(np.arange(6.0).reshape(2, 3)).astype(int)  # places of the free ones
        force = np.zeros(6)
        force[internal] = gradient
        force[3] = load
        found.append([force[3:5] @ along, force[3:5] @ sideways, force[5]])
        memory = potential.settled(deformation)
    return np.array(found)


OPTIONS = [
    (LINEAR, Unloading.SECANT),
    (Softening(Shape.EXPONENTIAL), Unloading.ELASTIC),
    (Softening(Shape.BILINEAR_TAIL), Unloading.SECANT),
]
TURNING = np.array(
    [[1, 0], [3, 1], [2, 4], [0, 1], [-1, 3], [4, -5], [40, 1], [-0.2, 3], [-0.2, 0]]
) * 1e-6  # fmt: skip


@pytest.mark.parametrize("kinematics", list(Kinematics))
@pytest.mark.parametrize(("softening", "unloading"), OPTIONS)
@pytest.mark.parametrize("turn", [0.0, 1.1, 4.0])
def test_one_bond_on_a_turning_path(turn, softening, unloading, kinematics) -> None:
    """Loaded, unloaded, turned, closed, broken and rubbed: forces and couple are those of the law in NumPy."""
    problem = one_bond(turn, kinematics, softening=softening, unloading=unloading, friction=0.4)
    found, state = forces_of_one_bond(problem, TURNING), problem.law.at_rest()
    for (opening, sliding), (tension, shear, couple) in zip(TURNING, found, strict=True):
        state = problem.law.advance(state, np.array([opening]), np.array([sliding]))
        exact = np.ravel(problem.law.forces(state, np.array([opening]), np.array([sliding])))
        lever = 1.0 if kinematics is Kinematics.SMALL else 2 * RADIUS / (2 * RADIUS + opening)
        # openings of 1e-6 from lengths of 1e-3 by round-off of 1e-16, times K: 1e-10 of the strength
        assert [tension, shear] == pytest.approx([exact[0], lever * exact[1]], abs=1e-8 * FN)
        assert couple == pytest.approx(-exact[1], abs=1e-8 * FN)  # −L/2 F_t over the radius


@pytest.mark.parametrize("angle", np.deg2rad([0, 25, 50, 75, 90, -40]))
def test_one_bond_along_a_fixed_direction(angle: float) -> None:
    """Linear softening: straight from the quadratic criterion of forces to the end of the linear one of energies."""
    a, b = np.cos(angle), np.sin(angle)
    onset = 1 / np.hypot(KN * a / FN, KS * b / FT)
    end = 1 / (onset * (KN * a**2 / (FN * DN) + KS * b**2 / (FT * DT)))
    size = np.array([0.5 * onset, onset, 0.7 * onset + 0.3 * end, 0.2 * onset + 0.8 * end, 1.01 * end])
    left = np.where(size <= onset, 1.0, np.maximum(onset * (end - size) / (size * (end - onset)), 0.0))
    found = forces_of_one_bond(one_bond(0.6, Kinematics.SMALL), size[:, None] * [a, b])
    # 1e-10 of the strength: openings from differences of displacements
    assert found[:, 0] == pytest.approx(left * KN * size * a, abs=1e-10 * FN)
    assert found[:, 1] == pytest.approx(left * KS * size * b, abs=1e-10 * FN)


def blocks(friction: float, columns: int = 9) -> Problem:
    """Two blocks of lattice, mirrored at y = 0, with upright bonds between them that break at once and then rub.

    The lower block stands on its lowest row, the upper is moved at its uppermost one: first down, then sideways.
    """
    rows, places = np.meshgrid(np.arange(4), np.arange(columns), indexing="ij")
    block = 2 * RADIUS * np.column_stack([(places + 0.5 * (rows % 2)).ravel(), (0.75**0.5 * rows).ravel()])
    position = np.vstack([block + np.array([0, RADIUS]), block * (1, -1) - (0, RADIUS)])
    distance = np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1))
    pairs = np.argwhere(np.triu(distance < 2.1 * RADIUS, 1)).astype(np.int32)
    across = np.diff(np.sign(position[pairs, 1]), axis=1).ravel() != 0
    pairs = pairs[~across | np.isclose(position[pairs[:, 0], 0], position[pairs[:, 1], 0])]
    across = np.diff(np.sign(position[pairs, 1]), axis=1).ravel() != 0
    n, m = len(position), len(pairs)
    particles = Particles(position, RADIUS, np.full(n, Phase.MASTIC, np.uint8), np.zeros(n, np.int32))
    bonds = Bonds(pairs, np.full(m, Phase.MASTIC, np.uint8), np.zeros(m, bool))
    weak = [np.where(across, v, np.inf) for v in (1e-6, 1e-6, 1e-12, 1e-12)]  # N, N, m, m: next to no strength
    rubbing = MixedSoftening(np.full(m, KN), KS, *weak, friction=friction)
    height = np.abs(position[:, 1])
    far = np.flatnonzero(height > height.max() - 0.1 * RADIUS)
    up, down = far[position[far, 1] > 0], far[position[far, 1] < 0]
    grips = tuple(_grip(f"down {i}", [i], d, 0.0, Role.GUIDE) for i in down for d in ((1.0, 0.0), (0.0, 1.0)))
    grips += tuple(_grip(f"press {i}", [i], (0.0, -1.0), 1.0, Role.DRIVE) for i in up)
    grips += tuple(_grip(f"slide {i}", [i], (1.0, 0.0), 0.0, Role.REACT) for i in up)
    gauge = Gauge(np.array([up[0], down[0]]), np.array([1.0, -1.0]))
    return Problem(BEAM, particles, bonds, rubbing, grips, gauge, Kinematics.SMALL, 1e-4, np.array([5e-5]))


@pytest.mark.parametrize("friction", [0.0, 0.3, 0.8])
def test_pressed_blocks_slide_at_coulombs_force(friction: float) -> None:
    """To and fro: the shear between the blocks ends at ± μ times what presses them, and friction takes its work."""
    problem, tolerance, pressing = blocks(friction), 1e-7 * FN, 2e-7
    slide = np.array([0, 1e-6, 3e-6, 3e-5, 6e-5, 5.99e-5, 5.7e-5, 3e-5, -6e-5])
    states = [rest(whole_model(problem))]
    for place in slide:
        stepper = Stepper(whole_model(replace(problem, grips=_driven(problem, pressing, place))), tolerance)
        guess = stepper.elastic().free if len(states) == 1 else states[-1].free
        found = stepper.by_machine(states[-1], guess, 1.0)
        assert found is not None
        states.append(found)
    press, shear = np.array([_machine_forces(problem, state) for state in states[1:]]).T
    assert press == pytest.approx(press[0], rel=0.2), "pressed throughout, a little less where the blocks tilt"
    slips, ways = [2, 3, 4, 6, 7, 8], np.array([1, 1, 1, -1, -1, -1])
    many = 40 * tolerance  # residuals of the particles of a block
    assert shear[slips] == pytest.approx(friction * ways * press[slips], abs=many)
    assert abs(shear[5]) < friction * press[5] or friction == 0, "sticks after it has turned back"
    work = np.sum(0.5 * (shear[1:] + shear[:-1]) * np.diff(slide))
    used = states[-1].memory.used.sum() - states[1].memory.used.sum()
    stored = states[-1].memory.stored.sum() - states[1].memory.stored.sum()
    assert used + stored == pytest.approx(work, abs=1e-6 * FN * 6e-5)  # work by trapezoids, as friction is booked
    assert used == pytest.approx(friction * press[0] * 1.8e-4, rel=0.05, abs=1e-12)  # the way, springs apart


def _driven(problem: Problem, press: float, slide: float) -> tuple[Grip, ...]:
    """The grips where the machine's one metre brings them: the upper block pressed and moved sideways, m."""
    drive = {"press": press, "slide": slide, "down": 0.0}
    return tuple(replace(g, drive=drive[g.name.split()[0]]) for g in problem.grips)


def _machine_forces(problem: Problem, state: State) -> tuple[float, float]:
    """What presses the uppermost row down and pushes it sideways, N: what its bonds do not take is the machine's."""
    _, direction = problem.bonds.reference(problem.particles.position)
    across = np.column_stack([-direction[:, 1], direction[:, 0]])
    force = state.memory.tension[:, None] * direction + state.memory.shear[:, None] * across
    row = [int(g.index[0]) for g in problem.grips if g.name.startswith("press")]
    held = np.isin(problem.bonds.pairs, row).astype(float)
    pulled = (held[:, :1] - held[:, 1:]).T @ force
    return float(pulled[0, 1]), float(-pulled[0, 0])


def test_next_to_no_shear_stiffness_is_the_central_engine() -> None:
    """K^s = 1e-8 K^n without a limit of its own: the same test as with central forces, increment by increment.

    Where a crack is open by a thousand δ_peak what slides still carries 1e-5 of the strength.
    """
    central = opened(fracture_test(radius=2 * MM, scatter=0.3), 0.3 * MM)
    own, weak = central.law, 1e-8
    slides = central.with_law(MixedSoftening(own.k_n, weak * own.k_n, own.f_max, 1e3 * own.f_max, own.delta_max, 1e9))
    way = np.linspace(0, 3e-4, 160)[1:]
    plain, mixed = ([*_driven_through(p, way)] for p in (central, slides))
    assert np.sum(plain[-1].memory.reached > own.delta_end) >= 3, "bonds broke on the way"
    loads, used = ([[f(s) for s in run] for run in (plain, mixed)] for f in (_load, _used))
    # what is said above, and residuals of 1e-5 of the strength, of a load that is some strengths at the end
    assert loads[1] == pytest.approx(loads[0], rel=1e-4)
    assert used[1] == pytest.approx(used[0], rel=1e-4, abs=1e-5 * used[0][-1])


def _driven_through(problem: Problem, way: np.ndarray) -> Iterator[State]:
    """The equilibria at machine displacements (k,), m, one after the other."""
    stepper = Stepper(whole_model(problem), 1e-5 * problem.law.f_max.min())
    state, elastic = rest(stepper.model), stepper.elastic()
    guess = way[0] * elastic.free
    for machine in way:
        found = stepper.by_machine(state, guess, machine)
        assert found is not None
        guess, state = 2 * found.free - state.free, found
        yield state


def _load(state: State) -> float:
    return state.load


def _used(state: State) -> float:
    return float(state.memory.used.sum())


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"friction": 0.5},
        {"kinematics": Kinematics.FINITE, "friction": 0.5},
        {"softening": Softening(Shape.EXPONENTIAL), "unloading": Unloading.ELASTIC},
    ],
    ids=["plain", "friction", "finite, friction", "exponential, elastic"],
)
def test_energy_of_a_beam_through_failure(options) -> None:
    problem = opened(small_beam(2.8 * MM, **SHEAR, **options), 0.4 * MM)
    solution = solve(problem)
    assert solution.converged
    assert np.sum(solution.reached > 0.9 * problem.law.delta_max) >= 10
    assert solution.energy.error < 1e-3  # trapezoids, and directions that turn within an increment; measured 1e-4
    assert solution.quasi_static_error < 1e-3


def opened(problem: Problem, end: float) -> Problem:
    """The same test up to another CMOD (m)."""
    return replace(problem, cmod_max=end, stations=np.array([0.3, 0.6, 0.9]) * end)
