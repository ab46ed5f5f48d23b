"""The path of equilibria from rest to the last CMOD, in increments small where the curve bends."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import ConvergenceError
from pipeline.equilibrium.model import ElasticResponse, State, moved_at_once, rest
from pipeline.equilibrium.step import Stepper

HALVINGS = 4  # of an increment in which load or energy leap, before that is taken for a jump


@dataclass(frozen=True)
class Increments:
    """How far one increment opens the mouth, as a share of the last CMOD.

    The defaults put two-phase beams of r = 0.6 mm within 0.1 % (load–CMOD) of increments four times smaller, one of
    0.3 mm within 0.7 % of increments half as long; twice larger ones differ by up to 2 %, for where single bonds snap
    they may take another way.

    Parameters
    ----------
    far : float; away from the peak
    near : float; up to the peak and behind it as long as the load exceeds `near_load` of the peak
    near_load : float
    leap : float; largest change of the load in one increment, as a share of the peak
    fading : float; share of its strength that a creeping bond may lose in one increment, were it held
    """

    far: float = 1 / 160
    near: float = 1 / 320
    near_load: float = 0.9
    leap: float = 0.1
    fading: float = 0.02

    def opening(self, state: State, peak: float, last: float, stations: np.ndarray) -> float:
        """How far (m) the next increment should open the mouth; it ends at a station that is near."""
        wanted = last * (self.near if state.load >= self.near_load * peak else self.far)
        targets = np.append(stations, last) - state.cmod
        ahead = targets[targets > 0.3 * wanted]
        if ahead.size and ahead[0] < 1.5 * wanted:
            return float(ahead[0])
        return wanted


@dataclass
class Path:
    """Follows equilibria under machine control, under CMOD control where the machine would snap back.

    Parameters
    ----------
    stepper : Stepper
    last : float, m; CMOD at which the path ends
    stations : (k,) array, m; CMOD values at which increments should end
    increments : Increments
    snap_back : bool; False: the machine only moves forward, and the crack jumps where it should move back
    jumps : int; how often the crack jumped
    released : float, J; energy that was set free thereby, which a slow explicit run gives to its damping
    """

    stepper: Stepper
    last: float
    stations: np.ndarray
    increments: Increments
    snap_back: bool = True
    gauge_controlled: bool = False
    jumps: int = 0
    released: float = 0.0
    peak: float = field(default=0.0)
    _stiff: float = field(default=1.0)  # machine displacement a CMOD while elastic

    def begin(self, elastic: ElasticResponse) -> tuple[State, State]:
        """Rest, and the state at which the first bond starts to soften or a first elastic increment ends."""
        model, start = self.stepper.model, rest(self.stepper.model)
        usage = float(np.max(start.memory.trial(0.0).usage(elastic.deformation), initial=0.0))
        self._stiff = 1 / elastic.cmod
        machine = 4 * self.increments.far * self.last / elastic.cmod
        first = moved_at_once(model, elastic, min(machine, 1 / usage) if usage > 0 else machine)
        if self.stepper.clock is None:
            return start, first
        return start, self._crept_there(start, first, elastic)

    def _crept_there(self, start: State, first: State, elastic: ElasticResponse) -> State:
        """The equilibrium that a first motion of the machine leads to in the time that it takes."""
        for halving in range(HALVINGS + 1):
            machine = first.machine / 2**halving
            if first.memory.fading(self.stepper.duration(start, machine * elastic.cmod)) <= self.increments.fading:
                break
        found = self.stepper.by_machine(start, machine * elastic.free, machine)
        if found is None:
            raise ConvergenceError("no first equilibrium found: allow more iterations or a larger tolerance")
        return found

    def done(self, state: State) -> bool:
        """Whether the last CMOD is reached."""
        return state.cmod >= self.last * (1 - 1e-9)

    def next(self, before: State, state: State) -> State:
        """The next equilibrium."""
        self.peak = max(self.peak, state.load)
        wanted = self.increments.opening(state, self.peak, self.last, self.stations)
        growth = float(np.clip(2 * (state.cmod - before.cmod) / wanted, 1 / 16, 1))
        return self.advance(before, state, self._soon(state, growth * wanted))

    def _soon(self, state: State, wanted: float) -> float:
        """An opening (m) that takes so little time that no bond fades by more than is allowed."""
        for _ in range(HALVINGS):
            if state.memory.fading(self.stepper.duration(state, state.cmod + wanted)) <= self.increments.fading:
                break
            wanted /= 2
        return wanted

    def advance(self, before: State, state: State, wanted: float) -> State:
        """The next equilibrium, at most `wanted` (m) further open, less where the load or the energy would leap."""
        self._choose_control(before, state)
        rough = None
        for halving in range(HALVINGS + 1):
            found = self._attempt(before, state, wanted / 2**halving)
            if found is not None and self._gained(state, found):
                found = self._attempt(before, state, wanted / 2**halving, self.stepper.careful())
            if found is not None and self._smooth(state, found):
                return found
            rough = found or rough
            self.gauge_controlled = self.snap_back and (self.gauge_controlled or halving >= 1)
        if rough is None:
            rough = self._machine(before, state, wanted / 2**HALVINGS, np.inf)
        if rough is None:
            rough = self._forced(state, wanted / 2**HALVINGS)
        if rough is None:
            raise ConvergenceError(
                f"no equilibrium found beyond CMOD = {state.cmod * 1e3:.4g} mm (load {state.load:.4g} N): "
                "allow more iterations, smaller increments or a larger tolerance"
            )
        self.jumps += 1
        self.released += _lost(state, rough)
        return rough

    def _smooth(self, state: State, found: State) -> bool:
        """Whether the load changed little and no energy was set free, as it is when a crack jumps."""
        little = self.increments.leap * self.peak * (1 + 1e-6)  # elastic increments grow to just that: no tie
        return abs(found.load - state.load) <= little and abs(_lost(state, found)) <= self._noise(state, found)

    def _gained(self, state: State, found: State) -> bool:
        """Whether bonds hold or have used up more than the machine gave: no specimen goes there by itself."""
        return _lost(state, found) < -self._noise(state, found)

    def _noise(self, state: State, found: State) -> float:
        """Energy (J) that the trapezoid of an increment may miss."""
        return 0.02 * self.increments.leap * self.peak * abs(found.cmod - state.cmod)

    def _choose_control(self, before: State, state: State) -> None:
        """Leave machine control where machine displacement hardly grows with CMOD; go back where it does again."""
        opened = state.cmod - before.cmod
        gain = (state.machine - before.machine) / (opened * self._stiff) if opened > 0 else 0.0
        self.gauge_controlled = self.snap_back and gain < (0.1 if self.gauge_controlled else 0.02)

    def _attempt(self, before: State, state: State, wanted: float, by: Stepper | None = None) -> State | None:
        if not self.gauge_controlled:
            return self._machine(before, state, wanted, 3 * wanted, by)
        share = wanted / (state.cmod - before.cmod)
        guess = state.free + share * (state.free - before.free)
        machine = state.machine + share * (state.machine - before.machine)
        return (by or self.stepper).by_gauge(state, guess, machine, state.cmod + wanted)

    def _machine(
        self, before: State, state: State, wanted: float, allowed: float, by: Stepper | None = None
    ) -> State | None:
        """A machine step that is expected to open the mouth by `wanted`; None where it opens more than allowed."""
        share = wanted / (state.cmod - before.cmod)
        guess = state.free + share * (state.free - before.free)
        machine = state.machine + share * (state.machine - before.machine)
        if machine <= state.machine:
            return None
        found = (by or self.stepper).by_machine(state, guess, machine)
        opened = found is not None and 0 < found.cmod - state.cmod <= allowed
        return found if opened else None

    def _forced(self, state: State, wanted: float) -> State | None:
        """Where the machine should move back, but no equilibrium has that CMOD either: it moves on, the crack jumps."""
        found = self.stepper.by_machine(state, state.free, state.machine + self._stiff * wanted)
        return found if found is not None and found.cmod > state.cmod else None


def _lost(state: State, found: State) -> float:
    """Work of the machine (J) between two states that is neither stored nor used up."""
    work = 0.5 * (state.load + found.load) * (found.machine - state.machine)
    return work - (found.energy - state.energy)
