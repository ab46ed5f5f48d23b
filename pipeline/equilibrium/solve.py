"""Solve a fracture test as a sequence of equilibria: Problem in, Solution out."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.problem import Problem, Solution
from pipeline.equilibrium.model import whole_model
from pipeline.equilibrium.path import Increments, Path
from pipeline.equilibrium.record import Record
from pipeline.equilibrium.step import Stepper

Progress = Callable[[float], None]


def solve(
    problem: Problem,
    *,
    tolerance: float = 1e-3,
    increments: Increments | None = None,
    limit: int = 400,
    strict: bool = True,
    progress: Progress | None = None,
) -> Solution:
    """The quasi-static solution of a fracture test.

    At every machine displacement the incremental potential is minimised; full fields at the problem's
    stations are interpolated linearly between two increments that lie close to them.

    Parameters
    ----------
    problem : Problem
    tolerance : float; largest force out of balance, as a share of the smallest f_max of the specimen
    increments : Increments; how far one increment opens the mouth
    limit : int; iterations after which an increment counts as failed and is halved
    strict : bool; False: a path that ends early is returned, not raised, with `converged` False
    progress : called with the share of the CMOD range that is done

    Raises
    ------
    ConvergenceError
        if no equilibrium is found before the last CMOD, unless `strict` is False and a part of the curve exists
    """
    started = time.process_time()
    _refuse(problem, tolerance)
    model = whole_model(problem)
    stepper = Stepper(model, limit=limit)
    path = Path(stepper, problem.cmod_max, problem.stations, increments or Increments())
    record = Record(problem)
    before, state = path.start()
    stepper.tolerance = tolerance * _reference_force(problem, state.opening)
    record.add(None, before, model)
    record.add(before, state, model)
    failure = None
    try:
        for following in path.follow(before, state):
            record.add(state, following, model)
            state = following
            if progress is not None:
                progress(min(state.cmod / problem.cmod_max, 1.0))
    except ConvergenceError as stopped:
        if strict or len(record.rows) < 3:  # two rows are no curve
            raise
        failure = str(stopped)
    message = failure or _message(path, state.cmod)
    return record.solution(state, time.process_time() - started, failure is None, message)


def _refuse(problem: Problem, tolerance: float) -> None:
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance:g} must lie between 0 and 1: it is a share of the smallest f_max")
    if not problem.cmod_max > 0:
        raise InputError(f"cmod_max = {problem.cmod_max:g} m must be positive")
    if problem.law.k_n.size != problem.bonds.count:
        raise InputError(f"the law has {problem.law.k_n.size} entries for {problem.bonds.count} bonds: give one a bond")


def _reference_force(problem: Problem, opening: np.ndarray) -> float:
    """The smallest f_max; without any, the largest force of the first elastic increment."""
    finite = problem.law.f_max[np.isfinite(problem.law.f_max)]
    return float(finite.min()) if finite.size else float(np.abs(problem.law.k_n * opening).max())


def _message(path: Path, cmod: float) -> str:
    jumps = f"; {path.jumps} jumps of the crack at constant machine displacement" if path.jumps else ""
    return f"equilibrium followed to CMOD = {cmod * 1e3:.4g} mm{jumps}"
