"""Networks of bonds that open and slide: gradients, rigid motions, and the continuum that a lattice stands for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import Gauge, Grip, Kinematics, Problem, Role
from pipeline.core.units import GPA, MM
from pipeline.equilibrium.network import FiniteNetwork, SmallNetwork, whole_network
from pipeline.materials.elastic import Plane, normal_stiffness, stiffness_ratio
from pipeline.materials.mixed_softening import MixedSoftening

from .specimens import BEAM

RADIUS = 0.8 * MM


def lattice(angle: float, kinematics: Kinematics, ratio: float = 0.3, scatter: float = 0.0) -> Problem:
    """A round piece of hexagonal lattice with rows at `angle`, its points moved by up to `scatter` radii."""
    rows, places = np.meshgrid(np.arange(-9, 10), np.arange(-9, 10), indexing="ij")
    position = np.stack([places + 0.5 * rows, 0.75**0.5 * rows], axis=-1).reshape(-1, 2) * 2 * RADIUS
    position = position[np.hypot(*position.T) < 9 * RADIUS]
    distance = np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1))
    pairs = np.argwhere(np.triu(distance < 2.1 * RADIUS, 1)).astype(np.int32)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    rng = np.random.default_rng(1)
    position = position @ turn + scatter * RADIUS * rng.uniform(-1, 1, position.shape)
    n, m = len(position), len(pairs)
    particles = Particles(position, RADIUS, np.full(n, Phase.MASTIC, np.uint8), np.zeros(n, np.int32))
    bonds = Bonds(pairs, np.full(m, Phase.MASTIC, np.uint8), np.zeros(m, bool))
    law = MixedSoftening(np.full(m, 1e8), ratio * 1e8, np.inf, np.inf, np.inf, np.inf)
    some = np.array([3, 5, 8])
    grips = (
        Grip("pulled", some, np.array([0.2, 0.3, 0.5]), np.array([0.6, 0.8]), 1.0, Role.DRIVE),
        Grip("held", np.array([n - 1]), np.ones(1), np.array([1.0, 0.0]), 0.0, Role.REACT),
        Grip("line", np.array([n - 1]), np.ones(1), np.array([0.0, 1.0]), 0.0, Role.GUIDE),
    )
    gauge = Gauge(np.array([0, n - 1]), np.array([1.0, -1.0]))
    return Problem(BEAM, particles, bonds, law, grips, gauge, kinematics, 1e-4, np.array([5e-5]))


@pytest.mark.parametrize("kinematics", list(Kinematics))
def test_forces_and_couples_are_the_gradient_of_the_energy(kinematics: Kinematics) -> None:
    """Σ F δ(q; s) with F fixed, on an irregular network bent and turned by a tenth of its size."""
    network, constraints = whole_network(lattice(0.3, kinematics, scatter=0.2))
    assert isinstance(network, SmallNetwork if kinematics is Kinematics.SMALL else FiniteNetwork)
    rng = np.random.default_rng(2)
    free = 0.2 * RADIUS * rng.normal(size=constraints.expand.shape[1])
    force, step = rng.normal(size=network.opening(free, 0.0).size), 1e-5 * RADIUS
    internal, load = network.pull(force, free, 0.1 * RADIUS)

    def work(free: np.ndarray, machine: float) -> float:
        return float(force @ network.opening(free, machine))

    numeric = [
        (work(free + move, 0.1 * RADIUS) - work(free - move, 0.1 * RADIUS)) / (2 * step)
        for move in step * np.eye(free.size)
    ]
    assert internal == pytest.approx(np.array(numeric), abs=1e-8)  # of 1 N: steps of 1e-5, second order
    driven = (work(free, 0.1 * RADIUS + step) - work(free, 0.1 * RADIUS - step)) / (2 * step)
    assert load == pytest.approx(driven, abs=1e-8)  # as above


@pytest.mark.parametrize("kinematics", list(Kinematics))
def test_stiffness_is_the_slope_of_the_forces_at_rest(kinematics: Kinematics) -> None:
    network, constraints = whole_network(lattice(0.3, kinematics, scatter=0.2))
    zero = np.zeros(constraints.expand.shape[1])
    weight = np.random.default_rng(3).uniform(0.5, 2, network.opening(zero, 0.0).size)
    move = 1e-7 * RADIUS * np.random.default_rng(4).normal(size=zero.size)
    matrix = network.stiffness(weight, zero, 0.0)
    force = [network.pull(weight * network.opening(q, 0.0), q, 0.0)[0] for q in (move, -move)]
    assert matrix @ (2 * move) == pytest.approx(force[0] - force[1], abs=1e-9 * np.abs(force[0]).max())  # third order
    assert np.linalg.eigvalsh(matrix.toarray()).min() > 0


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, -0.2)])
def test_rigid_motion_strains_nothing(shift: tuple[float, float]) -> None:
    """Turned by 0.1 rad: nothing with finite kinematics, θ²/2 and θ³/6 of the length with small ones."""
    problem, turn, stiffness, strength = lattice(0.3, Kinematics.FINITE), 0.1, 1e8, 71.0
    deformation = {k: _turned(replace(problem, kinematics=k), turn, np.array(shift) * MM) for k in Kinematics}
    assert np.abs(stiffness * deformation[Kinematics.FINITE]).max() < 1e-8 * strength
    opening, sliding = np.split(deformation[Kinematics.SMALL] / (2 * RADIUS), 2)
    assert opening == pytest.approx(np.cos(turn) - 1, abs=1e-12)  # round-off of lengths
    assert sliding == pytest.approx(np.sin(turn) - turn, abs=1e-12)
    assert np.abs(_turned(replace(problem, kinematics=Kinematics.SMALL), 1e-5, np.zeros(2))).max() < 1e-9 * RADIUS


def _turned(problem: Problem, turn: float, shift: np.ndarray) -> np.ndarray:
    """Deformations of the bonds when all particles move as one body; the grips follow it."""
    position = problem.particles.position
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    moved = np.column_stack([position @ matrix.T + shift - position, np.full(len(position), turn * RADIUS)])
    loose = replace(problem, grips=(_follows(problem, moved),))
    network, constraints = whole_network(loose)
    return network.opening(constraints.restrict(moved), 1.0)


def _follows(problem: Problem, moved: np.ndarray) -> Grip:
    """A grip on the first particle that prescribes where it is."""
    return Grip("one", np.array([0]), np.ones(1), np.array([1.0, 0.0]), float(moved[0, 0]), Role.DRIVE)


@pytest.mark.parametrize("poissons_ratio", [0.1, 0.2])
@pytest.mark.parametrize("plane", list(Plane))
@pytest.mark.parametrize("angle", np.deg2rad([0.0, 17.0, 30.0, 90.0]))
def test_a_patch_has_the_modulus_and_the_ratio_it_was_given(plane: Plane, poissons_ratio: float, angle: float) -> None:
    """Uniform strain, no particle turned: inner particles in balance, energy of the continuum in three directions.

    Plane stress: W/A t = E/(2(1 − ν²)) (ε_x² + ε_y² + 2ν ε_x ε_y + (1 − ν)/2 γ²); plane strain the same with
    E/(1 − ν²) and ν/(1 − ν). An inner particle owns half of each of its bonds and the area 2√3 r².
    """
    thickness, modulus = 40 * MM, 10 * GPA
    k_n = normal_stiffness(modulus, poissons_ratio, plane, thickness)
    k_s = k_n * stiffness_ratio(poissons_ratio, plane)
    problem = lattice(angle, Kinematics.SMALL)
    strains = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [1, -0.3, 0.7]]) * 1e-4  # ε_x, ε_y, γ
    inner = np.hypot(*problem.particles.position.T) < 6 * RADIUS
    loose = replace(problem, grips=(Grip("none", np.array([0]), np.ones(1), np.array([1.0, 0]), 0.0, Role.DRIVE),))
    first = problem.particles.position[0]  # stays: the grip holds it
    network, constraints = whole_network(loose)
    e, nu = (modulus, poissons_ratio)
    if plane is Plane.STRAIN:
        e, nu = modulus / (1 - poissons_ratio**2), poissons_ratio / (1 - poissons_ratio)
    for x, y, shear in strains:
        field = (problem.particles.position - first) @ np.array([[x, shear / 2], [shear / 2, y]])
        free = constraints.restrict(np.column_stack([field, np.zeros(len(field))]))
        deformation = network.opening(free, 0.0)
        stiffness = np.repeat([k_n, k_s], problem.bonds.count)
        internal = constraints.expand @ network.pull(stiffness * deformation, free, 0.0)[0]
        assert np.abs(internal.reshape(-1, 3)[inner]).max() < 1e-9 * k_n * RADIUS * 1e-4  # round-off of six forces
        energy = (0.5 * stiffness * deformation**2).reshape(2, -1).sum(axis=0)
        mine = np.bincount(problem.bonds.pairs.ravel(), np.repeat(energy / 2, 2), problem.particles.count)[inner]
        exact = e / (2 * (1 - nu**2)) * (x**2 + y**2 + 2 * nu * x * y + (1 - nu) / 2 * shear**2)
        assert mine == pytest.approx(exact * thickness * 2 * 3**0.5 * RADIUS**2, rel=1e-10)  # round-off
