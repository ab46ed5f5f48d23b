"""One fracture test by explicit steps in NumPy: problem in, solution out."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.core.errors import ConvergenceError
from pipeline.core.problem import Problem, Solution
from pipeline.explicit.frames import Frame
from pipeline.explicit.loading import Loading, loading_rule
from pipeline.explicit.modes import lowest_modes
from pipeline.materials.creeping_softening import refuse_timeless
from pipeline.reference.body import Body, body_of
from pipeline.reference.drive import Drive, Energies
from pipeline.reference.record import Record, Window, row
from pipeline.reference.step import Damping, Exchange, State, advance, at_rest_place


def solve(problem: Problem) -> Solution:
    """Run the problem step by step.

    Raises
    ------
    ConvergenceError
        if the gauge did not reach cmod_max
    """
    started = time.process_time()
    run = Run(problem)
    for _ in run.steps():
        pass
    cmod, steps = run.drive.cmod, run.step
    if cmod < problem.cmod_max:
        raise ConvergenceError(
            f"the gauge stopped at {cmod * 1e3:.4g} mm of {problem.cmod_max * 1e3:.4g} mm after {steps} steps: "
            "ask for less accuracy or a smaller cmod_max_mm"
        )
    return run.record.solution(problem, run.state.reached, time.process_time() - started)


def expectation(problem: Problem) -> str:
    """How many steps and how long a run may take, in words; right within a factor of two or three.

    The steps are those at the highest speed of an undamaged specimen: slowing down adds to them, the
    softer specimen behind the peak takes away. The time is 0.2 µs a bond and 0.3 ms a step (measured).
    """
    modes = lowest_modes(problem)
    steps = problem.cmod_max / (modes.cmod * loading_rule(problem, modes).highest_rate)
    seconds = steps * (3e-4 + 2e-7 * problem.bonds.count)
    lasting = f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
    return f"about {steps:.1g} steps of {problem.bonds.count} bonds in NumPy, in the order of {lasting}"


class Run:
    """A run under way: the particles, the machine, and what is noted of both.

    Parameters
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        refuse_timeless(problem)
        modes = lowest_modes(problem)
        self.problem, self.body = problem, body_of(problem)
        self.loading: Loading = loading_rule(problem, modes)
        self.damping = Damping(drag=2 * modes.omega, follow=modes.omega)
        self.share = self.loading.record * modes.omega / (2 * np.pi)  # of a period, between two records
        rate = self.loading.first_rate
        self.state = at_rest_place(self.body, rate * modes.response, rate * modes.rotation)
        moving = _kinetic(self.body, self.state)  # the specimen starts moving: the machine gave it that energy
        self.drive = Drive(self.loading.first_rate, self.loading.first_load, spent=moving)
        self.energy = Energies(moving, 0.0, 0.0, moving, 0.0)
        self.zero = self.body.gauge(self.state.position)
        self.step, self.load_line = 0, 0.0
        self.next_station = float(min(problem.stations, default=np.inf))
        self.window, self.record = Window(), Record()
        self._note(dict.fromkeys(("cmod_m", "load_n", "load_line_m", "drive_n", "react_n"), 0.0))

    def steps(self) -> Iterator[State]:
        """Go on until the gauge reads cmod_max or the run is given up; the state after every step."""
        while self.step < self.loading.steps_max and self.drive.cmod < self.problem.cmod_max:
            gauge = self.body.gauge(self.state.position)
            self.state, exchange = advance(self.body, self.state, self.damping, self.drive.rate)
            self.window.add(self.problem, gauge, self.load_line, exchange)
            self._book(exchange)
            if self.step % self.loading.record == 0:
                self._finish_window()
            yield self.state

    def _book(self, exchange: Exchange) -> None:
        energy = self.energy
        self.energy = replace(energy, external=energy.external + exchange.work, damping=energy.damping + exchange.lost)
        self.load_line += self.drive.rate
        self.step += 1

    def _finish_window(self) -> None:
        """Take the means, measure the lag, choose the speed, note a row and, past a station, a frame."""
        n, state = self.window.steps, self.state
        stored, used = state.memory.stored.sum(), state.memory.used.sum()
        kinetic = _kinetic(self.body, state)
        self.energy = replace(self.energy, stored=float(stored), dissipated=float(used), kinetic=kinetic)
        platen, support = self.window.drive / n, self.window.react / n
        means = {"cmod_m": self.window.gauge / n - self.zero, "load_n": (platen + support) / 2}
        means |= {"load_line_m": self.window.load_line / n, "drive_n": platen, "react_n": support}
        at = means["cmod_m"], means["load_n"], means["load_line_m"]
        self.drive = self.drive.measure(self.energy, *at, n, self.share)
        self._choose_rate()
        self._note(means)
        self.window = Window()
        if self.drive.cmod >= self.next_station:
            self.record.frames.append(Frame(self.step, self.state.position, self.state.velocity))
            ahead = self.problem.stations > self.drive.cmod
            self.next_station = float(min(self.problem.stations[ahead], default=np.inf))

    def _choose_rate(self) -> None:
        """Change the speed of machine and particles alike; kinetic energy that this takes out is damping."""
        lag, low, high = self.drive.allowed(self.loading.lag), self.loading.lowest_rate, self.loading.highest_rate
        factor = self.drive.factor(lag, self.share, low, high)
        self.state, self.drive = self.state.scaled(factor), replace(self.drive, rate=factor * self.drive.rate)
        kept = factor**2 * self.energy.kinetic
        lost = self.energy.kinetic - kept
        self.energy = replace(self.energy, kinetic=kept, damping=self.energy.damping + lost)

    def _note(self, means: dict[str, float]) -> None:
        drive = self.drive
        self.record.rows.append(row(self.step, means, self.energy, drive.rate, drive.error, drive.lag))


def _kinetic(body: Body, state: State) -> float:
    """Kinetic energy, J."""
    return 0.5 * float(np.sum(body.mass[:, None] * state.velocity**2) + np.sum(body.inertia * state.spin**2))
