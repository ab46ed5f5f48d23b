"""One diagnosis, from the baseline to the verdict; simulations come from a function that is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.errors import ConvergenceError
from pipeline.gap.closure import Closure, closure, folds, held_out, left_by_complete
from pipeline.gap.effect import MeasurementEffect
from pipeline.gap.effects import effect, library
from pipeline.gap.emulator import Emulator, Signature
from pipeline.gap.fit import Data, Fitted, fit
from pipeline.gap.gate import Gate, gate
from pipeline.gap.identifiability import Card, card
from pipeline.gap.library import Entry
from pipeline.gap.noise import noise_bic
from pipeline.gap.observation import Observation
from pipeline.gap.response import Abscissae, Response
from pipeline.gap.score import NONE, UNLISTED, Scored, pairs, score
from pipeline.gap.unlisted import unlisted
from pipeline.gap.verdict import Verdict, on_the_edge, verdict
from pipeline.gap.weighing import fitted_to, weighed
from pipeline.gap.where import Cell, where
from pipeline.inverse.design import Design

FACTORS = (0.7, 0.85, 1.0, 1.15, 1.3)  # of the start: wider than a fit needs, for effects pull parameters away
MOVES = 3  # how often the grid follows the best of the explanations that need no simulation
BESIDE = (0.002, -0.002)  # of f_max: where a node is tried again at which no equilibrium is found
NUDGES = ((0.003, 0.0), (0.0, 0.003), (-0.003, -0.003))  # of the parameters, relative: what may not matter
PLACEMENTS = (
    (0.5, 0.0),
    (0.25, 0.25),
    (0.75, 0.25),
)  # of a lattice, in its periods; with none: even
LIKELY = 0.05  # probability from which a physics effect is simulated again at its best point
CONFIRMED = 3  # at most so many
CLOSED = 3  # best explanations whose closure is looked at


@dataclass(frozen=True)
class Run:
    """One simulation that is asked for: parameters (N, m), physics effects by name, place of the lattice (periods)."""

    f_max: float
    delta_max: float
    effects: tuple[tuple[str, float], ...] = ()
    placement: tuple[float, float] = (0.0, 0.0)


Outcome = Response | str
"""A simulation, or why there is none."""

Simulate = Callable[[Sequence[Run]], list[Outcome]]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that was found.

    Parameters
    ----------
    observation : Observation, of the data that all simulations have
    emulator : Emulator
    data : Data
    fits : label → Fitted; "none" and "outside the library" among them
    scored : Scored
    card : Card
    gate : Gate
    cells : list of Cell; the table of where, for the model as it is
    closures : label → Closure, of the best explanations
    noise_bic : label → BIC against white noise alone, the smaller the better
    verdict : Verdict
    untested : effect → why it could not be judged
    runs : int; different simulations asked for
    """

    observation: Observation
    emulator: Emulator
    data: Data
    fits: Mapping[str, Fitted]
    scored: Scored
    card: Card
    gate: Gate
    cells: list[Cell]
    closures: Mapping[str, Closure]
    noise_bic: Mapping[str, float]
    verdict: Verdict
    untested: Mapping[str, str]
    runs: int

    @property
    def best(self) -> Fitted:
        """The most probable explanation."""
        return self.fits[self.scored.ranked()[0]]


class _Counted:
    """Simulations, each counted once."""

    def __init__(self, simulate: Simulate) -> None:
        self.simulate = simulate
        self.asked: set[Run] = set()

    def __call__(self, runs: Sequence[Run]) -> list[Outcome]:
        self.asked.update(runs)
        return self.simulate(runs)


def diagnose(
    observation: Observation,
    abscissae: Abscissae,
    simulate: Simulate,
    start: tuple[float, float],
    entry: Entry,
    rng: np.random.Generator,
    names: Sequence[str] | None = None,
    factors: tuple[float, ...] = FACTORS,
    closed: int = CLOSED,
) -> Diagnosis:
    """Diagnose one test.

    Parameters
    ----------
    observation : Observation
    abscissae : Abscissae at which `simulate` answers
    simulate : Simulate
    start : (f_max, δ_max), N and m; centre of the first grid
    entry : Entry of the library of discrepancies
    rng : numpy Generator; of bootstrap and floor
    names : effects to be tested, all where not given
    factors : of the grid
    closed : int; explanations whose closure is looked at

    Raises
    ------
    ConvergenceError
        where the baseline cannot be simulated
    """
    counted = _Counted(simulate)
    wanted = sorted(library() if names is None else names)
    emulator, near = baseline(observation, abscissae, counted, Design(start, factors, factors), entry, wanted)
    entry = fitted_to(entry, observation, emulator, near)
    if entry.discrepancy.placements > 0:
        emulator = with_placements(emulator, counted, emulator.rounded(near.parameters))
    seeming = {n for n in entry.apparent if n in library()}
    needed = sorted({*wanted, *seeming})  # what specimens only seem to have counts whether it is tested or not
    emulator, missing = with_signatures(emulator, counted, emulator.rounded(near.parameters), needed)
    untested = {n: why for n, why in missing.items() if n in wanted}
    known = [n for n in wanted if n not in untested]
    look = _Look(*weighed(observation, emulator, entry), known, entry.temperature)
    fits, scored = look.judge(emulator)
    emulator = confirmed(emulator, counted, fits, scored)
    return concluded(observation, emulator, entry, known, untested, rng, len(counted.asked), closed)


def concluded(
    observation: Observation,
    emulator: Emulator,
    entry: Entry,
    known: list[str],
    untested: Mapping[str, str],
    rng: np.random.Generator,
    runs: int,
    closed: int = CLOSED,
) -> Diagnosis:
    """Judge with all simulations at hand."""
    observation, data = weighed(observation, emulator, entry)
    fits, scored = _Look(observation, data, known, entry.temperature).judge(emulator)
    singles = {n: emulator.candidate([n], observation.mask) for n in known}
    best = fits[scored.first()]  # a wave that may have any shape would pass every gate
    table = card(singles, data, best.parameters, entry.temperature)
    left = data.target - best.candidate.predict(best.parameters, best.amplitudes)
    judged = gate(observation, left, uncertain(best, data), entry.freedom)
    none = fits[NONE]
    residual = data.target - none.candidate.predict(none.parameters, none.amplitudes)
    return Diagnosis(
        observation=observation,
        emulator=emulator,
        data=data,
        fits=fits,
        scored=scored,
        card=table,
        gate=judged,
        cells=where(observation, residual, data.metric.covariance),
        closures=closures(observation, emulator, data, fits, scored, rng, closed),
        noise_bic=noise_bic(observation, data, fits),
        verdict=on_the_edge(best) if best.at_edge else verdict(scored, table, judged),
        untested=untested,
        runs=runs,
    )


def uncertain(best: Fitted, data: Data) -> np.ndarray:
    """Covariance (n, n) of what an explanation leaves where it is right: Σ, and what it is itself uncertain by."""
    doubt = None if best.candidate.doubt is None else best.candidate.doubt(best.amplitudes)
    return data.metric.covariance if doubt is None else data.metric.covariance + doubt @ doubt.T


def baseline(
    observation: Observation,
    abscissae: Abscissae,
    simulate: Simulate,
    design: Design,
    entry: Entry,
    names: Sequence[str] = (),
) -> tuple[Emulator, Fitted]:
    """Simulate the grid; move it while the best explanation lies outside the middle of its outer cells.

    Explanations are the model as it is and the effects of the measurement among `names`, which cost no simulation: a
    gauge that reads too much pulls the parameters of the model as it is far from where they are.

    Returns
    -------
    the emulator, and the best explanation
    """
    measuring = [n for n in sorted(names) if isinstance(effect(n), MeasurementEffect)]
    clear = np.isfinite(observation.reading.field.sum(axis=2)).any(axis=0)
    for _ in range(MOVES + 1):
        outcomes = _nodes(simulate, [Run(f, d) for f, d in design.nodes()])
        values = np.reshape([o.flat() for o in outcomes], (*design.shape, -1))
        emulator = Emulator(observation.sight, abscissae, design.f_max, design.delta_max, values, clear=clear)
        look = _Look(*weighed(observation, emulator, entry), measuring, entry.temperature)
        fits, scored = look.judge(emulator, whole=False)
        best = fits[scored.first()]
        steps = [int(x > high) - int(x < low) for x, (low, high) in zip(best.parameters, emulator.inner, strict=True)]
        moved = design.moved(*steps)
        if moved == design:
            break
        design = moved
    return emulator, best


def _nodes(simulate: Simulate, runs: list[Run]) -> list[Response]:
    """The simulations of a grid; one that fails is made again right beside its node.

    Raises
    ------
    ConvergenceError
        where that fails too
    """
    outcomes = simulate(runs)
    missing = [k for k, o in enumerate(outcomes) if isinstance(o, str)]
    for shift in BESIDE:
        if missing:
            again = simulate([replace(runs[k], f_max=(1 + shift) * runs[k].f_max) for k in missing])
            for k, outcome in zip(missing, again, strict=True):
                outcomes[k] = outcome
            missing = [k for k in missing if isinstance(outcomes[k], str)]
    if missing:
        raise ConvergenceError(f"the baseline of the diagnosis cannot be simulated: {outcomes[missing[0]]}")
    return [o for o in outcomes if not isinstance(o, str)]


def with_placements(emulator: Emulator, simulate: Simulate, parameters: np.ndarray) -> Emulator:
    """With what the model says when its lattice lies elsewhere on the specimen; places that fail are left out."""
    at = (float(parameters[0]), float(parameters[1]))
    here, *others = simulate([Run(*at), *(Run(*at, placement=p) for p in PLACEMENTS)])
    if isinstance(here, str):
        raise ConvergenceError(f"the baseline of the diagnosis cannot be simulated: {here}")
    changes = [o.flat() - here.flat() for o in others if not isinstance(o, str)]
    return replace(emulator, placed=tuple(changes))


def with_signatures(
    emulator: Emulator, simulate: Simulate, parameters: np.ndarray, names: Sequence[str]
) -> tuple[Emulator, dict[str, str]]:
    """Simulate every physics effect at two values, and nudges of the parameters.

    Effects that cannot be simulated are returned with the reason.
    """
    wanted = [n for n in names if not isinstance(effect(n), MeasurementEffect)]
    at = (float(parameters[0]), float(parameters[1]))
    runs = [Run(*at)] + [Run(*at, ((n, v),)) for n in wanted for v in effect(n).magnitude.trials]
    beside = [Run(at[0] * (1 + f), at[1] * (1 + d)) for f, d in NUDGES]
    reference, *others = simulate([*runs, *beside])
    if isinstance(reference, str):
        raise ConvergenceError(f"the baseline of the diagnosis cannot be simulated: {reference}")
    signatures, untested = {}, {}
    for i, name in enumerate(wanted):
        both = others[2 * i : 2 * i + 2]
        reasons = [o for o in both if isinstance(o, str)]
        if reasons:
            untested[name] = reasons[0]
            continue
        changes = np.array([o.flat() - reference.flat() for o in both if not isinstance(o, str)])
        signatures[name] = Signature(np.array(effect(name).magnitude.trials), changes)
    again = [
        (np.array([r.f_max, r.delta_max]), o.flat())
        for r, o in zip(beside, others[-len(beside) :], strict=True)
        if not isinstance(o, str)
    ]
    placed = replace(emulator, signatures=signatures).confirmed(parameters, reference.flat())
    return replace(placed, again=tuple(again)), untested


@dataclass(frozen=True, eq=False)
class _Look:
    """What stays the same while the emulator becomes better."""

    observation: Observation
    data: Data
    names: list[str]
    temperature: float

    def judge(self, emulator: Emulator, whole: bool = True) -> tuple[dict[str, Fitted], Scored]:
        """Fit none and every effect; on the whole also one that the library lacks and pairs of the best; score them."""
        fits = {NONE: self._fit(emulator, ())}
        for name in self.names:
            fits[name] = self._fit(emulator, (name,))
        if whole and self.names:
            known = {name: fits[name].candidate for name in self.names}
            fits[UNLISTED] = unlisted(self.observation, self.data, fits[NONE], known)
        for pair in pairs(self._score(fits)) if whole else ():
            found = self._fit(emulator, pair)
            fits[found.candidate.label] = found
        return fits, self._score(fits)

    def _fit(self, emulator: Emulator, names: tuple[str, ...]) -> Fitted:
        return fit(emulator.candidate(names, self.observation.mask), self.data)

    def _score(self, fits: Mapping[str, Fitted]) -> Scored:
        evidence = {label: f.log_evidence for label, f in fits.items()}
        return score(evidence, len(self.names), self.temperature)


def confirmed(emulator: Emulator, simulate: Simulate, fits: Mapping[str, Fitted], scored: Scored) -> Emulator:
    """Simulate the likely physics effects at their best points, and let the emulator meet them there."""
    likely = [
        fits[label]
        for label in scored.ranked()
        if scored.probability[label] >= LIKELY
        and label in emulator.signatures
        and emulator.signatures[label].large(float(fits[label].amplitudes[0]))
    ][:CONFIRMED]
    runs = [_run_of(f) for f in likely]
    for found, outcome in zip(likely, simulate(runs) if runs else [], strict=True):
        if not isinstance(outcome, str):
            name, value = found.candidate.names[0], float(found.amplitudes[0])
            emulator = emulator.with_confirmed(name, value, found.parameters, outcome.flat())
    return emulator


def _run_of(found: Fitted) -> Run:
    f_max, delta_max = (float(x) for x in found.parameters)
    return Run(f_max, delta_max, ((found.candidate.names[0], float(found.amplitudes[0])),))


def closures(
    observation: Observation,
    emulator: Emulator,
    data: Data,
    fits: Mapping[str, Fitted],
    scored: Scored,
    rng: np.random.Generator,
    closed: int = CLOSED,
) -> dict[str, Closure]:
    """Closure of the best explanations, the runner-up's beside the first's; none is told a load that is held out."""
    within, across = folds(observation)
    if not within or not closed:
        return {}
    best = fits[NONE]
    none = held_out(best.candidate, data, within + across, best.parameters)
    complete = left_by_complete(best.candidate, data, within, best.parameters, rng)
    found, untold = {}, emulator.unloaded()
    for label in scored.causes()[:closed]:
        candidate = untold.candidate(fits[label].candidate.names, observation.mask)
        other = held_out(candidate, data, within + across, fits[label].parameters)
        found[label] = closure(observation, data, none, other, complete, rng.spawn(1)[0])
    return found
