"""What is kept of a path: the curve, the fields at the stations, the energies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import EnergyBalance, Problem, Solution
from pipeline.equilibrium.model import State

Fields = Callable[[State], np.ndarray]


@dataclass
class Record:
    """Collects the equilibria of one path; full fields are made only beside the stations.

    Parameters
    ----------
    problem : Problem
    """

    problem: Problem
    rows: list[tuple[float, float, float]] = field(default_factory=list)  # machine (m), CMOD (m), load (N)
    frames: list[np.ndarray] = field(default_factory=list)
    residual: float = 0.0
    error: float = 0.0
    iterations: int = 0

    def add(self, state: State, before: State | None, fields: Fields) -> None:
        """Take in the next equilibrium; interpolate the stations between it and the one before.

        `fields` gives the displacements (n, 2), m, of all particles in a state.
        """
        self.rows.append((state.machine, state.cmod, state.load))
        self.residual = max(self.residual, state.residual)
        self.error = max(self.error, state.error)
        self.iterations += state.iterations
        stations, k = self.problem.stations, len(self.frames)
        passed = np.searchsorted(stations, state.cmod * (1 + 1e-9), side="right")
        if before is None or passed <= k:
            return
        first, last = fields(before), fields(state)
        for station in stations[k:passed]:
            share = (station - before.cmod) / (state.cmod - before.cmod)
            self.frames.append((1 - share) * first + share * last)

    def curve(self) -> LoadCurve:
        """Load against CMOD; time counts at the CMOD rate of the test."""
        machine, cmod, load = np.asarray(self.rows).T
        time = np.maximum.accumulate(cmod) / self.problem.cmod_rate
        return LoadCurve(time=time, cmod=cmod, load=load, load_line=machine)

    def energy(self, state: State, released: float) -> EnergyBalance:
        """Work of the machine by trapezoids against what is stored and used up in the last state.

        What was set free where the crack jumped, `released` (J), is counted as taken out by damping.
        """
        machine, _, load = np.asarray(self.rows).T
        return EnergyBalance(
            external=float(np.trapezoid(load, machine)),
            stored=float(state.memory.stored.sum()),
            dissipated=float(state.memory.used.sum()),
            damping=released,
        )

    def solution(self, state: State, released: float, seconds: float, converged: bool, message: str) -> Solution:
        """Everything together, at the end of the path."""
        n = self.problem.particles.count
        return Solution(
            curve=self.curve(),
            cmod=self.problem.stations[: len(self.frames)],
            displacement=np.array(self.frames).reshape(-1, n, 2),
            reached=state.memory.reached,
            energy=self.energy(state, released),
            quasi_static_error=self.error,
            steps=len(self.rows) - 1,
            seconds=seconds,
            engine="equilibrium",
            converged=converged,
            message=message,
        )
