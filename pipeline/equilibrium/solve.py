"""Solve a fracture test as a sequence of equilibria: Problem in, Solution out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.problem import Problem, SlidingLaw, Solution
from pipeline.equilibrium import active
from pipeline.equilibrium.condensation import CondensedModel, condense
from pipeline.equilibrium.model import State, WholeModel, whole_model
from pipeline.equilibrium.path import Increments, Path
from pipeline.equilibrium.record import Record
from pipeline.equilibrium.step import Stepper
from pipeline.equilibrium.watch import Watch
from pipeline.materials.creeping_softening import refuse_timeless

TOLERANCE = 2e-4  # five times larger, and a crack may stay on a path that is no minimum any more

Progress = Callable[[float], None]


def solve(
    problem: Problem,
    *,
    tolerance: float = TOLERANCE,
    increments: Increments | None = None,
    limit: int = 400,
    condensed: bool = True,
    snap_back: bool = True,
    strict: bool = True,
    progress: Progress | None = None,
) -> Solution:
    """The quasi-static solution of a fracture test.

    At every machine displacement the incremental potential is minimised; full fields at the problem's
    stations are interpolated linearly between the two increments around them, one of which ends close by.

    Parameters
    ----------
    problem : Problem
    tolerance : float; largest force out of balance, as a share of the smallest f_max of the specimen
    increments : Increments; how far one increment opens the mouth
    limit : int; iterations after which an increment counts as failed and is halved
    condensed : bool; eliminate what stays elastic (exact, and checked), under small kinematics
    snap_back : bool; False: the machine only moves forward, as in the explicit engines
    strict : bool; False: a path that ends early is returned, not raised, with `converged` False
    progress : called with the share of the CMOD range that is done

    Raises
    ------
    ConvergenceError
        if no equilibrium is found before the last CMOD, unless `strict` is False and a part of the curve exists
    """
    started = time.process_time()
    _refuse(problem, tolerance)
    journey = _Journey(problem, tolerance, increments or Increments(), limit, condensed, snap_back)
    failure = None
    try:
        while not journey.path.done(journey.state):
            journey.step()
            if progress is not None:
                progress(min(journey.state.cmod / problem.cmod_max, 1.0))
    except ConvergenceError as stopped:
        if strict or len(journey.record.rows) < 3:  # two rows are no curve
            raise
        failure = str(stopped)
    message = failure or journey.message()
    seconds = time.process_time() - started
    return journey.record.solution(journey.whole_state(), journey.path.released, seconds, failure is None, message)


class _Journey:
    """A path, the model it is followed on, which may grow on the way, and what is recorded."""

    def __init__(
        self,
        problem: Problem,
        tolerance: float,
        increments: Increments,
        limit: int,
        condensed: bool,
        snap_back: bool,
    ):
        self.whole = whole_model(problem)
        chosen = active.strip(problem)
        part = condense(self.whole, chosen) if condensed and active.pays(problem, chosen) else None
        elastic = part.elastic() if part else Stepper(self.whole).elastic()
        self.record = Record(problem)
        self.model: WholeModel | CondensedModel = self.whole
        strongest = float(np.abs(problem.law.k_n * elastic.deformation[: problem.bonds.count]).max())
        first = strongest * 4 * (increments.far * problem.cmod_max / elastic.cmod)
        force = tolerance * _reference_force(problem, first)
        stepper = Stepper(self.whole, force, limit, clock=problem.clock)
        self.path = Path(stepper, problem.cmod_max, problem.stations, increments, snap_back)
        self.before, self.state = self.path.begin(elastic)
        for state, before in ((self.before, None), (self.state, self.before)):
            self.record.add(state, before, self.fields)
        self.watch, self.looked = Watch(), 1
        self.ahead: list[State] = []
        self.safe = (self.before, self.state, self.path)
        if part:
            self._adopt(part)

    def step(self) -> None:
        """One increment; if it is time, a look at the far bonds, which may take increments back."""
        if not self.ahead:
            self.safe = (self.before, self.state, replace(self.path))
        found = self.path.next(self.before, self.state)
        self.ahead.append(found)
        self.before, self.state = self.state, found
        if isinstance(self.model, CondensedModel):
            if len(self.ahead) < self.watch.interval and not self.path.done(found):
                return
            usage = self.model.usage(found)
            damaged = self.watch.damaged(usage)
            if damaged.any():
                self._take_back(self.model.grown(damaged))
                return
            self._keep()
            soon = self.watch.expected(usage, self.looked)
            if soon.any():
                self._adopt(self.model.grown(soon))
        else:
            self._keep()

    def _keep(self) -> None:
        """The increments since the last look are good."""
        before = self.safe[1]
        for found in self.ahead:
            self.record.add(found, before, self.fields)
            before = found
        self.looked = len(self.ahead)
        self.ahead = []

    def _take_back(self, model: CondensedModel) -> None:
        """Do the increments since the last look again with a larger model."""
        self.before, self.state, self.path = self.safe
        self.ahead = []
        self.watch.restart()
        self._adopt(model)

    def fields(self, state: State) -> np.ndarray:
        """Displacements (n, 2), m, of all particles in a state of the model in use."""
        free = state.free if isinstance(self.model, WholeModel) else self.model.complete(state.free, state.machine)
        return self.whole.displacement(free, state.machine)

    def whole_state(self) -> State:
        """The last state, with all bonds and variables."""
        return self._expanded(self.state)

    def message(self) -> str:
        """One sentence on how the run ended."""
        jumps = self.path.jumps
        times = "once" if jumps == 1 else f"{jumps} times"
        leaps = f"; the crack jumped {times}, {self.path.released * 1e3:.3g} mJ were set free" if jumps else ""
        return f"equilibrium followed to CMOD = {self.state.cmod * 1e3:.4g} mm{leaps}"

    def _expanded(self, state: State) -> State:
        return state if isinstance(self.model, WholeModel) else self.model.expand(state)

    def _adopt(self, model: CondensedModel) -> None:
        """Go on with another model of the same specimen: the first condensed one, or one grown from that in use."""
        now = self.model
        carry = model.reduce if isinstance(now, WholeModel) else partial(now.carry, grown=model)
        self.before, self.state = carry(self.before), carry(self.state)
        self.model = model
        self.path.stepper = self.path.stepper.on(model)


def _refuse(problem: Problem, tolerance: float) -> None:
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance:g} must lie between 0 and 1: it is a share of the smallest f_max")
    if not problem.cmod_max > 0:
        raise InputError(f"cmod_max = {problem.cmod_max:g} m must be positive")
    refuse_timeless(problem)
    if problem.law.k_n.size != problem.bonds.count:
        raise InputError(f"the law has {problem.law.k_n.size} entries for {problem.bonds.count} bonds: give one a bond")


def _reference_force(problem: Problem, elastic: float) -> float:
    """The smallest strength; without any, the largest tension (N) of a first elastic increment."""
    law = problem.law
    strength = np.append(law.f_max, law.f_shear) if isinstance(law, SlidingLaw) else law.f_max
    finite = strength[np.isfinite(strength) & np.isfinite(np.resize(law.f_max, strength.size))]
    return float(finite.min()) if finite.size else elastic
