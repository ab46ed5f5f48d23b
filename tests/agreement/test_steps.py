"""The NumPy engine and LAMMPS, step by step through failure, for every kind of law."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.problem import Kinematics, Problem
from pipeline.core.units import MM
from pipeline.lmp import simulate
from pipeline.lmp.output import read_curve
from pipeline.materials.burgers import Burgers
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.softening import Shape, Softening, Unloading
from pipeline.reference.solve import Run

from .lockstep import Snapshot, lammps_steps

SAME = 1e-9  # asked for, of the particle radius, the largest f_max and the largest delta_max
MASTIC = Burgers(d1=1e-10, d2=0.7e-10, eta1=1e12, tau2=10.0)
SLIDING: dict[str, Any] = {"poissons_ratio": 0.2, "shear_strength_ratio": 0.7, "shear_opening_ratio": 1.2}
PLAIN = {"small": {}, "finite": {"kinematics": Kinematics.FINITE}}
OTHERS = {
    "elastic unloading, long tail": {"softening": Softening(Shape.BILINEAR_TAIL), "unloading": Unloading.ELASTIC},
    "sliding": {**SLIDING, "friction": 0.3},
    "sliding, finite, exponential": {
        **SLIDING,
        "kinematics": Kinematics.FINITE,
        "softening": Softening(Shape.EXPONENTIAL),
        "unloading": Unloading.ELASTIC,
    },
    "creep": {"mastic": MASTIC},
    "creep, finite": {"mastic": MASTIC, "kinematics": Kinematics.FINITE},
}


def tiny_beam(**options: Any) -> Problem:
    """A two-phase SE(B) of 294 particles, opened until several bonds are broken."""
    return small_beam(2.8 * MM, **{"cmod_max": 0.3 * MM, "accuracy": 0.03, **options})


def difference(problem: Problem, run: Run, lammps: Snapshot) -> np.ndarray:
    """Largest difference after a step: positions/r, forces/f_max, rotations, history/delta_max, speed, lag, time."""
    law, state = problem.law, run.state
    damageable = np.isfinite(law.f_max)
    peak, strength, radius = law.delta_peak[damageable], law.f_max[damageable].max(), problem.particles.radius
    # LAMMPS notes openings only from delta_peak on, and some laws none beyond their end: there is nothing to remember
    mine, theirs = (np.clip(a.reached[damageable], peak, law.delta_end[damageable]) for a in (state, lammps))
    history = mine - theirs
    return np.array(
        [
            np.abs(state.position - lammps.position).max() / radius,
            np.abs(state.force - lammps.force).max() / strength,
            np.abs(state.angle - lammps.angle).max(),
            np.abs(state.torque - lammps.torque).max() / (strength * radius),
            np.abs(history).max() / law.delta_max[damageable].max(),
            abs(run.drive.rate / lammps.rate - 1),
            abs(run.drive.lag - lammps.lag),
            abs(state.time - lammps.time),
        ]
    )


def go_on_from(run: Run, lammps: Snapshot) -> None:
    """Let the run continue where LAMMPS is; of its own it keeps its sums and the running mean of the velocity.

    That goes with the speed of the machine, as particles do when it changes.
    """
    pace = lammps.rate / run.drive.rate
    place = {name: getattr(lammps, name) for name in ("position", "velocity", "force", "angle", "spin", "torque")}
    means = {"mean": run.state.mean * pace, "mean_spin": run.state.mean_spin * pace}
    run.state = replace(run.state, **place, **means, memory=lammps.memory(run.problem.law), time=lammps.time)
    run.drive = replace(run.drive, rate=lammps.rate, lag=lammps.lag)


@pytest.mark.parametrize("name", [*PLAIN, *OTHERS])
def test_every_step_is_that_of_lammps(name: str, tmp_path: Path) -> None:
    """Each step begins where LAMMPS is, for a softening specimen magnifies round-off as it magnifies anything."""
    # the further laws are opened less far: their steps are dearer
    tiny = tiny_beam(**PLAIN[name]) if name in PLAIN else tiny_beam(accuracy=0.3, **OTHERS[name])
    run, worst = Run(tiny), np.zeros(8)
    for _, lammps in zip(run.steps(), lammps_steps(tiny, tmp_path), strict=False):
        worst = np.maximum(worst, difference(tiny, run, lammps))
        go_on_from(run, lammps)
    assert run.drive.cmod >= tiny.cmod_max
    assert np.count_nonzero(run.state.reached > 0.9 * tiny.law.delta_max) >= 3, "bonds must have broken on the way"
    # history of sliding bonds is found from D; the speed follows the lag, a difference of 1e-3 between sums
    history = 1e-7 if isinstance(tiny.law, MixedSoftening) else SAME
    assert np.all(worst < [SAME, SAME, SAME, SAME, history, 1e-7, SAME, 1e-8]), worst


@pytest.mark.parametrize("name", PLAIN)
def test_whole_runs_agree(name: str, tmp_path: Path) -> None:
    """Side by side from the first step to the last, each on its own."""
    tiny = tiny_beam(**PLAIN[name])
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
    for column, values in record.items():
        mine = run.record.column(column)
        # as above; motion and drag are small differences of large sums
        tolerance = 1e-4 if column in ("kinetic_j", "damping_j", "lag", "rate_m") else 1e-6
        assert mine == pytest.approx(values, abs=tolerance * np.abs(values).max()), column


@pytest.mark.parametrize("name", OTHERS)
def test_energy_is_accounted_for(name: str, tmp_path: Path) -> None:
    solution = simulate.solve(small_beam(1.8 * MM, cmod_max=0.1 * MM, **OTHERS[name]), tmp_path)
    assert solution.energy.error < 1e-3, solution.energy  # asked for; measured up to 1.6e-4
    assert solution.energy.kinetic + solution.energy.damping < 0.01 * solution.energy.external  # measured 0.1 %
