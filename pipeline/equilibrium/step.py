"""One increment: from one equilibrium to the next, under machine or under CMOD control."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.core.clock import Clock
from pipeline.equilibrium.factor import factorise_elastic
from pipeline.equilibrium.minimise import Minimum, minimise
from pipeline.equilibrium.model import ElasticResponse, Model, State
from pipeline.equilibrium.potential import Potential, SecantPreconditioner
from pipeline.materials.memory import at_rest

CORRECTIONS = 8  # of the duration of an increment under machine control
PUNCTUAL = 5e-3  # share of an increment's duration by which it may miss the clock; the next one makes up for it
CAREFUL = 0.25  # of the largest δ_max: a bond that is opened so far in one step still pulls back


@dataclass
class Stepper:
    """Finds equilibria of one model; keeps its factorised stiffness as long as it serves.

    Parameters
    ----------
    model : Model
    tolerance : float, N; largest force out of balance
    limit : int; iterations after which a minimisation counts as failed
    patience : int; iterations after which a minimisation renews its factorisation
    endurance : int; iterations after which the next minimisation begins with a new one
    clock : Clock or None; time of the test, for bonds that creep
    reach : float, m; how far one step may move a variable
    """

    model: Model
    tolerance: float = np.inf
    limit: int = 400
    patience: int = 25
    endurance: int = 40
    clock: Clock | None = None
    reach: float = np.inf
    _preconditioner: SecantPreconditioner = field(default_factory=SecantPreconditioner, repr=False)
    _spent: int = field(default=0, repr=False)

    def on(self, model: Model) -> Stepper:
        """The same stepper for another model."""
        return Stepper(model, self.tolerance, self.limit, self.patience, self.endurance, self.clock)

    def careful(self) -> Stepper:
        """The same stepper with steps so short that none leaps over the strength of a bond.

        A particle that hardly any bond holds may otherwise fly off in one step, through bonds that would hold it.
        """
        law = self.model.law
        ends = law.delta_max[np.isfinite(law.f_max)]
        return replace(self, reach=CAREFUL * float(ends.max(initial=0.0)) or np.inf, _spent=self.endurance)

    def duration(self, start: State, cmod: float) -> float:
        """How long (s) the test takes from an equilibrium to a CMOD; none to one that it had before."""
        return 0.0 if self.clock is None else max(self.clock.at(cmod) - start.time, 0.0)

    def elastic(self) -> ElasticResponse:
        """How the undamaged specimen answers a motion of the machine that takes no time."""
        zero = np.zeros(self.model.gauge.size)
        network, stiffness = self.model.network, at_rest(self.model.law).trial(0.0).elastic
        tiny = 1e-9  # a motion so small that true lengths are linear in it
        pull, _ = network.pull(stiffness * network.opening(zero, tiny), zero, 0.0)
        free = -factorise_elastic(network.stiffness(stiffness, zero, 0.0)).solve(pull) / tiny
        deformation = network.opening(tiny * free, tiny) / tiny
        _, load = network.pull(stiffness * deformation, zero, 0.0)
        return ElasticResponse(free, load, self._cmod(free, 1.0), deformation)

    def by_machine(self, start: State, guess: np.ndarray, machine: float) -> State | None:
        """The equilibrium at a machine displacement; None where none was found.

        How long the increment takes, the clock tells of the CMOD that is found. What relaxes at a held machine hardly
        moves the mouth, so that one or two corrections of an extrapolated duration are enough.
        """
        duration = self.duration(start, self._cmod(guess, machine))
        for _ in range(CORRECTIONS):
            found, potential = self._minimum(start, duration, guess, machine, self.tolerance, None)
            if not found.converged:
                return None
            true = self.duration(start, self._cmod(found.at, machine))
            if abs(true - duration) <= PUNCTUAL * true:
                return self._state(found, potential, machine, start.time + duration)
            duration, guess = true, found.at
        return None

    def by_gauge(self, start: State, guess: np.ndarray, machine: float, cmod: float) -> State | None:
        """The equilibrium at a CMOD, the machine displacement adjusted until the gauge carries no force."""
        gauge = self.model.gauge
        trials: list[tuple[float, float]] = []
        reach = max(abs(machine - start.machine), 0.01 * abs(start.machine))
        duration = self.duration(start, cmod)
        for _ in range(15):
            miss = cmod - self._cmod(guess, machine)
            guess = guess + gauge * (miss / (gauge @ gauge))
            found, potential = self._minimum(start, duration, guess, machine, 0.5 * self.tolerance, gauge)
            if not found.converged:
                return None
            if abs(found.multiplier) * np.abs(gauge).max() <= 0.5 * self.tolerance:
                return self._state(found, potential, machine, start.time + duration)
            trials.append((machine, found.multiplier))
            machine, guess = _next_trial(trials, reach), found.at
        return None

    def _minimum(
        self,
        start: State,
        duration: float,
        guess: np.ndarray,
        machine: float,
        tolerance: float,
        constraint: np.ndarray | None,
    ) -> tuple[Minimum, Potential]:
        potential = Potential(self.model.network, start.memory, duration)
        self._preconditioner.move(potential, machine)
        if self._preconditioner.factor is None or self._spent >= self.endurance:
            self._preconditioner.renew(guess)
            self._spent = 0
        found = minimise(
            lambda free: potential.gradient(free, machine),
            self._preconditioner,
            guess,
            tolerance,
            constraint,
            self.limit,
            self.patience,
            self.reach,
        )
        self._spent += found.iterations
        return found, potential

    def _state(self, found: Minimum, potential: Potential, machine: float, time: float) -> State:
        gradient, load, deformation = potential.state(found.at, machine)
        memory = potential.settled(deformation)
        size = float(np.linalg.norm(found.at))
        return State(
            free=found.at,
            machine=machine,
            load=load,
            cmod=self._cmod(found.at, machine),
            memory=memory,
            time=time,
            energy=potential.energy(found.at, machine, memory),
            residual=float(np.abs(gradient).max()),
            error=float(np.linalg.norm(found.step)) / size if size else 0.0,
            iterations=found.iterations,
        )

    def _cmod(self, free: np.ndarray, machine: float) -> float:
        return float(self.model.gauge @ free) + machine * self.model.gauge_drive


def _next_trial(trials: list[tuple[float, float]], reach: float) -> float:
    """Machine displacement at which the gauge force (N) would vanish: more travel relieves a pulling gauge."""
    machine, force = trials[-1]
    if len(trials) == 1:
        return machine + 0.2 * reach * float(np.sign(force))
    before, force_before = trials[-2]
    slope = (force - force_before) / (machine - before)
    step = -force / slope if slope < 0 else float(np.sign(force)) * reach
    return machine + float(np.clip(step, -2 * reach, 2 * reach))
