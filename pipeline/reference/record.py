"""What is noted while a run goes on: means over the steps since the last record, energies, frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import EnergyBalance, Problem, Role, Solution
from pipeline.explicit.frames import Frame, fields_at_stations
from pipeline.reference.drive import Energies
from pipeline.reference.step import Exchange


@dataclass
class Window:
    """Sums over the steps since the last record."""

    steps: int = 0
    gauge: float = 0.0
    load_line: float = 0.0
    drive: float = 0.0
    react: float = 0.0

    def add(self, problem: Problem, gauge: float, load_line: float, exchange: Exchange) -> None:
        """Take in a step: gauge and machine (m) as they were before it, and what it exchanged."""
        self.steps += 1
        self.gauge += gauge
        self.load_line += load_line
        for grip, reaction in zip(problem.grips, exchange.reaction, strict=True):
            self.drive += reaction if grip.role is Role.DRIVE else 0.0
            self.react += reaction if grip.role is Role.REACT else 0.0


@dataclass(frozen=True)
class Row:
    """One record; the names are those of curve.txt of a LAMMPS run."""

    step: int
    cmod_m: float
    load_n: float
    load_line_m: float
    drive_n: float
    react_n: float
    external_j: float
    stored_j: float
    dissipated_j: float
    kinetic_j: float
    damping_j: float
    rate_m: float
    quasi_static_error: float
    lag: float


@dataclass
class Record:
    """All rows and frames of a run."""

    rows: list[Row] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)

    def column(self, name: str) -> np.ndarray:
        """One column over all rows."""
        return np.array([getattr(row, name) for row in self.rows])

    def solution(self, problem: Problem, reached: np.ndarray, seconds: float) -> Solution:
        """Everything together, at the end of a run."""
        cmod, last = self.column("cmod_m"), self.rows[-1]
        stations, displacement = fields_at_stations(problem, self.frames)
        curve = LoadCurve(cmod / problem.cmod_rate, cmod, self.column("load_n"), self.column("load_line_m"))
        return Solution(
            curve=curve,
            cmod=stations,
            displacement=displacement,
            reached=reached,
            energy=EnergyBalance(last.external_j, last.stored_j, last.dissipated_j, last.kinetic_j, last.damping_j),
            quasi_static_error=last.quasi_static_error,
            steps=last.step,
            seconds=seconds,
            engine="reference",
            converged=True,
            message=f"the gauge reached {problem.cmod_max * 1e3:.4g} mm",
        )


def row(step: int, means: dict[str, float], energy: Energies, rate: float, error: float, lag: float) -> Row:
    """A record from its parts."""
    energies = {f"{name}_j": value for name, value in vars(energy).items()}
    return Row(step=step, rate_m=rate, quasi_static_error=error, lag=lag, **means, **energies)
