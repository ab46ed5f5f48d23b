"""One step in time: damped leapfrog, grips as impulses, bond forces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.problem import Grip
from pipeline.materials.cohesive import central_law
from pipeline.reference.body import Body


@dataclass(frozen=True)
class State:
    """The particles at one step; velocities are those half a step before.

    Parameters
    ----------
    position : (n, 2) array, m
    velocity, mean : (n, 2) arrays, m per step; v, and its running mean v̄
    force : (n, 2) array, N; of the bonds
    opening, reached : (m,) arrays, m; of the bonds, now and at most
    """

    position: np.ndarray
    velocity: np.ndarray
    mean: np.ndarray
    force: np.ndarray
    opening: np.ndarray
    reached: np.ndarray

    def scaled(self, factor: float) -> State:
        """The same place at another speed."""
        return replace(self, velocity=factor * self.velocity, mean=factor * self.mean)


@dataclass(frozen=True)
class Damping:
    """Drag c towards the running mean of the velocity, which follows at α; both per step."""

    drag: float
    follow: float


@dataclass(frozen=True)
class Exchange:
    """What one step exchanged with the outside: reactions (grips,), N; work of the machine and loss by damping, J."""

    reaction: np.ndarray
    work: float
    lost: float


def at_rest_place(body: Body, velocity: np.ndarray) -> State:
    """The undeformed specimen, moving with `velocity` (n, 2), m per step."""
    bonds = np.zeros(body.length.size)
    start = State(body.problem.particles.position, velocity, velocity, np.zeros_like(velocity), bonds, bonds)
    return with_bond_forces(body, start)


def with_bond_forces(body: Body, state: State) -> State:
    """The state with openings, history and forces that belong to its positions."""
    opening, direction = body.bonds_at(state.position)
    tension = central_law(body.problem.law, "reference").force(opening, state.reached)
    reached = np.maximum(opening, state.reached)
    return replace(state, force=body.forces(tension, direction), opening=opening, reached=reached)


def advance(body: Body, state: State, damping: Damping, rate: float) -> tuple[State, Exchange]:
    """One step with the machine at `rate` (m per step).

        v* = (v + f/m + c v̄)/(1 + c)
        J_g = (a_g rate − Σ w d·v*) / Σ w²/m          the impulse that gives grip g its mean velocity
        v' = v* + Σ_g J_g w d/m,   x' = x + v',   v̄' = v̄ + α (v' − v̄)

    The reaction of a grip is R_g = (1 + c) J_g. Damping takes away ½ c m (v' − v̄)·(v + v'), exactly.
    """
    c, mass = damping.drag, body.mass[:, None]
    velocity = (state.velocity + state.force / mass + c * state.mean) / (1 + c)
    impulse = np.array([_impulse(grip, body.mass, velocity, rate) for grip in body.grips])
    for grip, own in zip(body.grips, impulse, strict=True):
        velocity[grip.index] += own * (grip.weight / body.mass[grip.index])[:, None] * grip.direction
    slip = velocity - state.mean
    lost = 0.5 * c * float(np.sum(mass * slip * (state.velocity + velocity)))
    moved = replace(
        state, position=state.position + velocity, velocity=velocity, mean=state.mean + damping.follow * slip
    )
    reaction = (1 + c) * impulse
    work = rate * float(reaction @ [grip.drive for grip in body.grips])
    return with_bond_forces(body, moved), Exchange(reaction, work, lost)


def _impulse(grip: Grip, mass: np.ndarray, velocity: np.ndarray, rate: float) -> float:
    """Impulse (N step) along the grip's direction that gives its particles the mean velocity of the machine."""
    missing = grip.drive * rate - grip.mean(velocity)
    return missing / float(np.sum(grip.weight**2 / mass[grip.index]))
