"""The NumPy engine and LAMMPS, step by step through failure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.problem import Kinematics, Problem
from pipeline.core.units import MM
from pipeline.lmp import simulate
from pipeline.lmp.output import read_curve
from pipeline.reference.solve import Run

from .lockstep import Snapshot, lammps_steps

SAME = 1e-9  # asked for, of the particle radius, the largest f_max and the largest delta_max


@pytest.fixture(scope="module", params=list(Kinematics))
def tiny(request: pytest.FixtureRequest) -> Problem:
    """A two-phase SE(B) of 294 particles, opened until several bonds are broken."""
    return small_beam(2.8 * MM, cmod_max=0.3 * MM, kinematics=request.param, accuracy=0.03)


def difference(problem: Problem, run: Run, lammps: Snapshot) -> np.ndarray:
    """Largest difference after a step of positions/r, forces/f_max, history/delta_max, speed and lag."""
    law, state = problem.law, run.state
    damageable = np.isfinite(law.f_max)
    peak = law.delta_peak[damageable]
    # LAMMPS notes openings only from delta_peak on: below it there is nothing to remember
    history = np.maximum(state.reached[damageable], peak) - np.maximum(lammps.reached[damageable], peak)
    return np.array(
        [
            np.abs(state.position - lammps.position).max() / problem.particles.radius,
            np.abs(state.force - lammps.force).max() / law.f_max[damageable].max(),
            np.abs(history).max() / law.delta_max[damageable].max(),
            abs(run.drive.rate / lammps.rate - 1),
            abs(run.drive.lag - lammps.lag),
        ]
    )


def go_on_from(run: Run, lammps: Snapshot) -> None:
    """Let the run continue where LAMMPS is; of its own it keeps its sums and the running mean of the velocity.

    That goes with the speed of the machine, as particles do when it changes.
    """
    seen = np.maximum(lammps.reached, np.minimum(run.state.reached, run.problem.law.delta_peak))
    place = {"position": lammps.position, "velocity": lammps.velocity, "force": lammps.force, "reached": seen}
    run.state = replace(run.state, mean=run.state.mean * (lammps.rate / run.drive.rate), **place)
    run.drive = replace(run.drive, rate=lammps.rate, lag=lammps.lag)


def test_every_step_is_that_of_lammps(tiny: Problem, tmp_path: Path) -> None:
    """Each step begins where LAMMPS is, for a softening specimen magnifies round-off as it magnifies anything."""
    run, worst = Run(tiny), np.zeros(5)
    for _, lammps in zip(run.steps(), lammps_steps(tiny, tmp_path), strict=False):
        worst = np.maximum(worst, difference(tiny, run, lammps))
        go_on_from(run, lammps)
    assert run.drive.cmod >= tiny.cmod_max
    assert np.count_nonzero(run.state.reached > tiny.law.delta_max) >= 3, "bonds must have broken on the way"
    # the speed follows the lag, a difference of 1e-3 between sums, and so has a larger round-off
    assert np.all(worst < [SAME, SAME, SAME, 1e-7, SAME]), worst


def test_whole_runs_agree(tiny: Problem, tmp_path: Path) -> None:
    """Side by side from the first step to the last, each on its own."""
    run = Run(tiny)
    for _ in run.steps():
        pass
    solution = run.record.solution(tiny, run.state.reached, 0.0)
    lammps = simulate.solve(tiny, tmp_path)
    assert solution.steps == lammps.steps
    # snaps magnify round-off, here to 3e-12 (small) and 6e-11 (finite); elsewhere 1e-8 was seen
    off = np.abs(solution.displacement - lammps.displacement).max() / tiny.particles.radius
    assert off < SAME
    record = read_curve(tmp_path / "curve.txt")
    for name, column in record.items():
        mine = run.record.column(name)
        # as above; motion and drag are small differences of large sums
        tolerance = 1e-4 if name in ("kinetic_j", "damping_j", "lag", "rate_m") else 1e-6
        assert mine == pytest.approx(column, abs=tolerance * np.abs(column).max()), name
