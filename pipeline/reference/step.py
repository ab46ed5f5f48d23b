"""One step in time: damped leapfrog, grips as impulses, bond forces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.problem import Grip
from pipeline.materials.memory import Memory, at_rest
from pipeline.reference.body import Body


@dataclass(frozen=True)
class State:
    """The particles at one step; velocities are those half a step before.

    Parameters
    ----------
    position : (n, 2) array, m
    velocity, mean : (n, 2) arrays, m per step; v, and its running mean v̄
    force : (n, 2) array, N; of the bonds
    angle, spin, mean_spin, torque : (n,) arrays; the same for rotations, rad, rad per step, N m
    memory : Memory; of the bonds
    widest : float, m; largest CMOD, without its zero
    time : float, s; when the test was there
    """

    position: np.ndarray
    velocity: np.ndarray
    mean: np.ndarray
    force: np.ndarray
    angle: np.ndarray
    spin: np.ndarray
    mean_spin: np.ndarray
    torque: np.ndarray
    memory: Memory
    widest: float
    time: float = 0.0

    @property
    def opening(self) -> np.ndarray:
        """Openings (m,), m, of the bonds."""
        return self.memory.opening

    @property
    def reached(self) -> np.ndarray:
        """Largest opening (m,), m, of every bond, or its like."""
        return self.memory.reached

    def scaled(self, factor: float) -> State:
        """The same place at another speed."""
        names = ("velocity", "mean", "spin", "mean_spin")
        return replace(self, **{name: factor * getattr(self, name) for name in names})


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


def at_rest_place(body: Body, velocity: np.ndarray, spin: np.ndarray | None = None) -> State:
    """The undeformed specimen, moving with `velocity` (n, 2), m per step, and `spin` (n,), rad per step, if any."""
    place = body.problem.particles.position
    still, none = np.zeros_like(velocity), np.zeros(len(velocity))
    spin = none if spin is None else spin
    memory = at_rest(body.problem.law)
    start = State(place, velocity, velocity, still, none, spin, spin, none, memory, widest=body.gauge(place))
    return with_bond_forces(body, start, 0.0)


def with_bond_forces(body: Body, state: State, duration: float) -> State:
    """The state with bonds and forces that belong to its positions, `duration` s of the test later."""
    opening, sliding, pull = body.bonds_at(state.position, state.angle)
    memory = state.memory.follow(opening, sliding, duration)
    force, torque = body.forces(memory.tension, memory.shear, pull)
    return replace(state, memory=memory, force=force, torque=torque)


def advance(body: Body, state: State, damping: Damping, rate: float) -> tuple[State, Exchange]:
    """One step with the machine at `rate` (m per step).

        v* = (v + f/m + c v̄)/(1 + c)
        J_g = (a_g rate − Σ w d·v*) / Σ w²/m          the impulse that gives grip g its mean velocity
        v' = v* + Σ_g J_g w d/m,   x' = x + v',   v̄' = v̄ + α (v' − v̄)

    The reaction of a grip is R_g = (1 + c) J_g. Damping takes away ½ c m (v' − v̄)·(v + v'), exactly. Rotations go the
    same way, with no grips. Bonds creep for as long as the test took from the largest CMOD before to that now.
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
    if body.rotates:
        moved, more = _turned(body, moved, damping)
        lost += more
    reaction = (1 + c) * impulse
    work = rate * float(reaction @ [grip.drive for grip in body.grips])
    moved, duration = _timed(body, moved)
    return with_bond_forces(body, moved, duration), Exchange(reaction, work, lost)


def _turned(body: Body, state: State, damping: Damping) -> tuple[State, float]:
    """Rotations one step on, and the energy that damping took from them, J."""
    c = damping.drag
    spin = (state.spin + state.torque / body.inertia + c * state.mean_spin) / (1 + c)
    slip = spin - state.mean_spin
    lost = 0.5 * c * float(np.sum(body.inertia * slip * (state.spin + spin)))
    mean = state.mean_spin + damping.follow * slip
    return replace(state, angle=state.angle + spin, spin=spin, mean_spin=mean), lost


def _timed(body: Body, state: State) -> tuple[State, float]:
    """The state at the test's time, and how much of it went by, s; none where nothing creeps."""
    clock = body.problem.clock
    if clock is None:
        return state, 0.0
    widest = max(state.widest, body.gauge(state.position))
    now = clock.at(widest - body.gauge(body.problem.particles.position))
    return replace(state, widest=widest, time=now), now - state.time


def _impulse(grip: Grip, mass: np.ndarray, velocity: np.ndarray, rate: float) -> float:
    """Impulse (N step) along the grip's direction that gives its particles the mean velocity of the machine."""
    missing = grip.drive * rate - grip.mean(velocity)
    return missing / float(np.sum(grip.weight**2 / mass[grip.index]))
