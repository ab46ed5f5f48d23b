"""Quasi-static fracture of a body: damped Newton steps on the incremental energy, increment by increment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from pipeline.blind.body import Body, sewn
from pipeline.blind.bulk import Bulk, Memory
from pipeline.blind.machine import STIFF, Machine
from pipeline.blind.tie import LOOSENED, TOO_LATE, Tie, strained
from pipeline.blind.traction import Edges
from pipeline.core.errors import ConvergenceError

TOLERANCE, AT_LEAST = 3e-4, 3e-3  # of the strength of an edge: largest force out of balance, wanted and put up with
ITERATIONS, HALVINGS, DOUBLINGS = 50, 14, 6
CAUTIOUS = 0.3, 0.02  # shares of the softening left out of the tangent after bad steps: grows by, forgotten below
FIRST_STEP, STEPS = 4e-6, 55  # m of CMOD before and around the peak; steps of the rest
FINE_UNTIL = 60e-6  # m of CMOD
SMALLEST = 1 / 64  # of a step
LEAST, PATIENCE = 0.05, 6  # of the wanted step: an increment that opens less rests; so many may follow each other
SLOWEST = 1e-2  # of the rate of the mouth: slower openings count as this
RAMP = 0.1  # of the softening branch, over which the rate law sets in


@dataclass(frozen=True, eq=False)
class Setup:
    """A test to be solved.

    Parameters
    ----------
    body, machine, edges, bulk : what is broken, by what, its edges and triangles
    spent : (q,) array, m; largest λ seen before the test
    friction : float; at contacts that rub
    cmod_rate : float, m/s; of the real test
    rate_law : float; relative change of strength per decade of opening rate over that of the mouth
    ties : bool; edges are tied until they carry half their strength
    """

    body: Body
    machine: Machine
    edges: Edges
    bulk: Bulk
    spent: np.ndarray
    friction: float = 0.0
    cmod_rate: float = 1e-5
    rate_law: float = 0.0
    ties: bool = True

    def stiffness(self, span: float) -> csr_matrix:
        """Of the triangles in an increment of so many seconds, N/m."""
        return self.bulk.stiffness(self.body, span) if self.bulk.relaxation.weight else self.elastic

    @cached_property
    def elastic(self) -> csr_matrix:
        """Of the triangles at once, N/m."""
        return self.bulk.stiffness(self.body, 0.0)


@dataclass(frozen=True, eq=False)
class State:
    """Where a test stands.

    Parameters
    ----------
    machine : float, m
    moved : (size,) array, m
    reached : (q,) array, m
    memory : Memory of the bulk
    opening_rate : (q,) array, m/s
    tie : Tie
    work : float, J; of the machine, and of friction on the specimen
    time : float, s
    """

    machine: float
    moved: np.ndarray
    reached: np.ndarray
    memory: Memory
    opening_rate: np.ndarray
    tie: Tie
    work: float = 0.0
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class Path:
    """Increments of a solved test: arrays over the increments, the first one unloaded.

    machine (k,) m, cmod (k,) m, load (k,) N, moved (k, size) m, reached (k, q) m; energies (J) at the end.
    """

    machine: np.ndarray
    cmod: np.ndarray
    load: np.ndarray
    moved: np.ndarray
    reached: np.ndarray
    work: float
    stored: float
    dissipated: float
    iterations: int = field(default=0)

    @property
    def energy_error(self) -> float:
        """|work − stored − dissipated| / work."""
        return abs(self.work - self.stored - self.dissipated) / abs(self.work)


@dataclass(eq=False)
class _Increment:
    """One increment to be solved for the independent displacements (n,): everything that stays while Newton steps."""

    setup: Setup
    tie: Tie
    edges: Edges
    reached: np.ndarray
    bulk: csr_matrix
    place: float
    outer: np.ndarray

    @classmethod
    def of(
        cls,
        setup: Setup,
        tie: Tie,
        edges: Edges,
        reached: np.ndarray,
        bulk: csr_matrix,
        place: float,
        outer: np.ndarray,
    ) -> _Increment:
        """From edges, openings and forces of the whole body."""
        spread = tie.spread
        return cls(
            setup, tie, edges.at(tie.points), reached[tie.points], (spread.T @ bulk @ spread).tocsr(), place,
            spread.T @ outer,
        )  # fmt: skip

    @cached_property
    def rows(self) -> csr_matrix:
        """Of the machine's contacts."""
        return (self.setup.machine.rows @ self.tie.spread).tocsr()

    @cached_property
    def weight(self) -> np.ndarray:
        """(q,) array, m²"""
        return self.setup.body.weight[self.tie.points]

    @cached_property
    def elastic(self) -> csr_matrix:
        """Triangles and machine."""
        return (self.bulk + STIFF * self.rows.T @ self.rows).tocsr()

    @cached_property
    def pushed(self) -> np.ndarray:
        """All forces that do not depend on the displacements."""
        return self.outer + STIFF * self.place * (self.rows.T @ self.setup.machine.drive)

    def opening(self, moved: np.ndarray) -> np.ndarray:
        """(q, 2) array, m"""
        return np.asarray(self.tie.opener @ moved).reshape(-1, 2)

    def energy(self, moved: np.ndarray) -> float:
        """Not by way of `elastic` and `pushed`, whose large parts cancel."""
        parted = self.edges.energy(self.opening(moved), self.reached) @ self.weight
        springs = self.setup.machine.drive * self.place - self.rows @ moved
        stored = 0.5 * moved @ (self.bulk @ moved) + 0.5 * STIFF * float(springs @ springs)
        return float(stored - self.outer @ moved + parted)

    def out_of_balance(self, moved: np.ndarray) -> np.ndarray:
        pull = self.edges.traction(self.opening(moved), self.reached) * self.weight[:, None]
        return np.asarray(self.elastic @ moved - self.pushed + self.tie.opener.T @ pull.ravel())

    def step(self, moved: np.ndarray, rest: np.ndarray, softening: float) -> np.ndarray:
        tangent = self.edges.tangent(self.opening(moved), self.reached, softening)
        matrix = (self.elastic + sewn(self.tie.opener, self.weight, tangent)).tocsc()
        return -_solve(matrix, rest)


def _solve(matrix: csr_matrix, right: np.ndarray) -> np.ndarray:
    """The nodes of a body are numbered for elimination (`blind.order`)."""
    found: np.ndarray = splu(
        matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).solve(right)
    return found


def _newton(increment: _Increment, start: np.ndarray, tolerance: float) -> tuple[np.ndarray, int]:
    """Displacements in balance, and the iterations taken.

    Raises
    ------
    ConvergenceError
        where the forces stay out of balance
    """
    moved, energy, caution = start, increment.energy(start), 0.0
    for count in range(ITERATIONS):
        rest = increment.out_of_balance(moved)
        if np.abs(rest).max() < tolerance:
            return moved, count
        step = increment.step(moved, rest, 1 - caution)
        if rest @ step >= 0:
            caution = 1.0
            step = increment.step(moved, rest, 0.0)
        moved, energy, share = _walked(increment, moved, energy, step, float(rest @ step), caution > 0)
        caution = _warned(caution, share)
    if np.abs(rest).max() < tolerance * AT_LEAST / TOLERANCE:
        return moved, ITERATIONS  # edges at the corner between two branches change sides for ever
    raise ConvergenceError(f"forces stay out of balance by {np.abs(rest).max():.2g} N after {ITERATIONS} iterations")


def _warned(caution: float, share: float) -> float:
    """How much of the softening the next tangent leaves out, after a step that was cut to a share."""
    grow, forget = CAUTIOUS
    if share < 0.2:
        return min(caution + grow * (1 - caution), 1.0)
    calmer = 0.4 * caution if share >= 1 else caution
    return calmer if calmer > forget else 0.0


def _walked(
    increment: _Increment, moved: np.ndarray, energy: float, step: np.ndarray, slope: float, short: bool
) -> tuple[np.ndarray, float, float]:
    """The farthest of halved steps that lowers the energy enough (Armijo 1966); of doubled ones where steps are short.

    Steps without softening in their tangent are short: where the specimen lets go, the energy falls far beyond them.
    """
    share, there = 1.0, increment.energy(moved + step)
    for _ in range(HALVINGS):
        if there <= energy + 1e-4 * share * slope + 1e-14 * abs(energy):
            break
        share /= 2
        there = increment.energy(moved + share * step)
    for _ in range(DOUBLINGS if short and share == 1 else 0):
        farther = increment.energy(moved + 2 * share * step)
        if farther >= there:
            break
        share, there = 2 * share, farther
    return moved + share * step, there, share


def solve(setup: Setup, cmod_max: float) -> Path:
    """Drive the machine until the gauge reads `cmod_max` (m).

    Raises
    ------
    ConvergenceError
        where an increment has no equilibrium
    """
    tie = Tie(setup.body, _loose_at_first(setup))
    state = State(0.0, np.zeros(setup.body.size), setup.spent, setup.bulk.fresh(), np.zeros(len(setup.spent)), tie)
    states, total, stretch = [state], 0, _first_stretch(setup, tie)
    before, resting = np.zeros(setup.body.size), 0
    while setup.machine.cmod(states[-1].moved) < cmod_max:
        state, share = states[-1], 1.0
        wanted = _wanted(setup.machine.cmod(state.moved), cmod_max)
        while True:
            try:
                new, count = _advance(setup, state, share * wanted, share * wanted * stretch, before * share * wanted)
                break
            except ConvergenceError as error:
                share /= 2
                if share < SMALLEST:
                    raise ConvergenceError(
                        f"at a CMOD of {setup.machine.cmod(state.moved) * 1e3:.3g} mm {error}"
                    ) from error
        opened = setup.machine.cmod(new.moved) - setup.machine.cmod(state.moved)
        resting = 0 if opened > LEAST * share * wanted else resting + 1
        if resting > PATIENCE:
            raise ConvergenceError(
                f"the mouth does not open further at a CMOD of {setup.machine.cmod(state.moved) * 1e3:.3g} mm: the "
                "test snaps back under a moving platen"
            )
        if not resting:
            stretch, before = (new.machine - state.machine) / opened, (new.moved - state.moved) / opened
        states.append(new)
        total += count
    return _path(setup, states, total)


def _wanted(cmod: float, cmod_max: float) -> float:
    """CMOD (m) of the next increment."""
    coarse = cmod_max / STEPS
    return min(FIRST_STEP, coarse) if cmod < FINE_UNTIL else coarse


def _loose_at_first(setup: Setup) -> np.ndarray:
    """Edges (c,) that are never tied: all, or those that were hurt before the test."""
    hurt: np.ndarray = np.asarray(np.max(setup.spent.reshape(-1, 2), axis=1) > 0)
    return hurt if setup.ties else np.ones(len(hurt), bool)


def _first_stretch(setup: Setup, tie: Tie) -> float:
    """Machine displacement per CMOD of the sound specimen."""
    nothing = np.zeros(setup.body.size)
    first = _Increment.of(setup, tie, setup.edges, setup.spent, setup.elastic, 1.0, nothing)
    start = tie.gathered(nothing)
    moved = first.step(start, first.out_of_balance(start), 0.0)
    return 1.0 / setup.machine.cmod(tie.spread @ moved)


def _advance(setup: Setup, state: State, cmod: float, machine: float, guess: np.ndarray) -> tuple[State, int]:
    """The state after one increment of about `cmod` and exactly `machine` (m)."""
    body, place = setup.body, state.machine + machine
    span = max((setup.machine.cmod(state.moved) + cmod) / setup.cmod_rate - state.time, 1e-9)
    bulk = setup.stiffness(span)
    outer = -setup.bulk.history(body, state.memory, state.moved, span)
    edges = _at_rate(setup, state)
    tolerance = TOLERANCE * (float(np.median(edges.strength * body.weight)) if body.weight.size else 1.0)
    moved, total, tie = state.moved + guess, 0, state.tie
    rubbing = np.zeros(body.size)
    slips = 1 if not setup.friction else 4
    while slips:
        if setup.friction:
            rubbing = setup.machine.friction(moved, place, setup.friction)
        increment = _Increment.of(setup, tie, edges, state.reached, bulk, place, outer + rubbing)
        found, count = _newton(increment, tie.gathered(moved), tolerance)
        moved, total = np.asarray(tie.spread @ found), total + count
        load_share = np.where(tie.loose, 0.0, strained(body, setup.bulk, edges, moved))
        if np.any(load_share > LOOSENED):
            tie = Tie(body, tie.loose | (load_share > LOOSENED))
        slips -= bool(np.all(load_share < TOO_LATE))
    now = edges.effective(body.opening(moved))
    load = 0.5 * (setup.machine.load(moved, place) + setup.machine.load(state.moved, state.machine))
    work = state.work + load * machine + float(rubbing @ (moved - state.moved))
    rate = np.maximum(now - edges.effective(body.opening(state.moved)), 0.0) / span
    rate = 0.7 * state.opening_rate + 0.3 * rate  # of the last few increments: one alone would swing
    memory = setup.bulk.remember(body, state.memory, moved - state.moved, span)
    reached = np.maximum(state.reached, now)
    return replace(
        state, machine=place, moved=moved, reached=reached, memory=memory, opening_rate=rate, tie=tie, work=work,
        time=state.time + span,
    ), total  # fmt: skip


def _at_rate(setup: Setup, state: State) -> Edges:
    """Edges with the strength of the rate at which those that soften opened last."""
    if not setup.rate_law:
        return setup.edges
    decades = np.log10(np.maximum(state.opening_rate / setup.cmod_rate, SLOWEST))
    begun = np.minimum(setup.edges.way(state.reached) / RAMP, 1.0)  # no jump where softening begins
    factor = 1 + setup.rate_law * decades * begun
    return replace(setup.edges, strength=setup.edges.strength * np.maximum(factor, 0.05))


def _path(setup: Setup, states: list[State], iterations: int) -> Path:
    body, machine, end = setup.body, setup.machine, states[-1]
    opened = np.maximum.accumulate([machine.cmod(s.moved) for s in states])
    states = [s for s, new in zip(states, np.diff(opened, prepend=-1.0) > 0, strict=True) if new]
    lost = setup.edges.dissipated(end.reached) - setup.edges.dissipated(setup.spent)
    kept = setup.edges.stored(body.opening(end.moved), end.reached) @ body.weight
    bulk = setup.bulk.stored(body, end.memory, end.moved)
    return Path(
        machine=np.array([s.machine for s in states]),
        cmod=np.array([machine.cmod(s.moved) for s in states]),
        load=np.array([machine.load(s.moved, s.machine) for s in states]),
        moved=np.array([s.moved for s in states]),
        reached=np.array([s.reached for s in states]),
        work=end.work,
        stored=float(kept) + bulk + machine.stored(end.moved, end.machine),
        dissipated=float(lost @ body.weight),
        iterations=iterations,
    )
