"""The table of engines: which path a run was judged by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import Solution
from pipeline.equilibrium.solve import solve
from pipeline.study import engine_tables
from pipeline.study.engines import Engine
from pipeline.study.specimens import Trial, bond_in_series


def stronger(solution: Solution, factor: float, message: str) -> Solution:
    """The same with another load and message."""
    curve = solution.curve
    load = LoadCurve(curve.time, curve.cmod, factor * curve.load, curve.load_line)
    return replace(solution, curve=load, message=message)


@pytest.mark.parametrize(
    ("factor", "message", "told"),
    [
        (1.0, "followed", ""),
        (1.1, "followed", "strengths 2"),
        (1.0, "the crack jumped", "jump"),
        (1.1, "the crack jumped", "jump, strengths 2"),
    ],
)
def test_the_path_is_told_beside_a_jump(monkeypatch, factor, message, told):
    trial = Trial("a bond", bond_in_series(), np.empty((0, 2)))
    run = solve(trial.problem)

    def other(problem):
        nonlocal asked
        asked += problem is not trial.problem
        return stronger(run, 1.0 if asked == 2 else factor, message)  # the second of other strengths is the run's own

    asked = 0
    monkeypatch.setattr("pipeline.study.paths.field_difference", lambda *_: 0.0)  # there are no points
    monkeypatch.setattr(engine_tables, "engine", lambda name: Engine(name, other))
    monkeypatch.setattr(engine_tables.lammps, "solve", lambda _: run)
    [*_, row] = engine_tables.engine_rows([trial], [0.01])
    assert row.split(" | ")[-2].strip() == told
