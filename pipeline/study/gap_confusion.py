"""The confusion table: every effect at multiples of its detection limit, none, and effects that the library lacks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.gap.effects import effect, library
from pipeline.gap.library import Entry
from pipeline.gap.score import NONE, UNLISTED, names_of
from pipeline.gap.verdict import CAUSE, CLASS, NONE_NEEDED, OUTSIDE, SURE
from pipeline.study.batch import Batch
from pipeline.study.gap_calibration import answer, sized
from pipeline.study.gap_trials import Bench, Trial, unseen

TIMES = (2.0, 4.0)  # detection limits
HEAD = ("put in", "times limit", "seed", "verdict", "named", "P of it", "estimate, 95 %", "closure, 95 %")


def confusion(
    batch: Batch,
    file: Path,
    seeds: Sequence[int],
    *,
    free: Sequence[int] = (),
    names: Sequence[str] = (),
    times: Sequence[float] = TIMES,
    removed: bool = True,
) -> str:
    """Make the trials of the table, write table.md, return the summary; goes on where it stopped.

    Parameters
    ----------
    file : library
    seeds : specimens that carry effects, every effect on one of them after the other; none of library or calibration
    free : further specimens that carry none
    names : effects, all that the diagnosis can test where not given
    times : detection limits, at most the plausible maximum
    removed : whether every effect is also diagnosed by a library that lacks it
    """
    benches = unseen(batch.with_creep(), file, [*seeds, *free])
    trials: list[Trial] = []
    for bench in benches:
        batch.progress.stage(f"seed {bench.seed}, nothing")
        trials += bench.tried({}, closed=1)
    for k, name in enumerate(names or library()):
        bench = benches[k % len(seeds)]
        for value in sizes(bench, name, times):
            batch.progress.stage(f"seed {bench.seed}, {name} = {value:g}")
            trials += bench.tried({name: value}, closed=1)
            if removed:
                trials += bench.tried({name: value}, (name,), closed=1)
    entry = benches[0].entry
    (batch.out / "table.md").write_text(table(trials, entry), "utf-8")
    return summary(trials, entry)


def sizes(bench: Bench, name: str, times: Sequence[float]) -> list[float]:
    """Different sizes of an effect by the card of the specimen without effects; none where it is not tested."""
    known = bench.tried({}, closed=1)
    if not known or name not in known[0].limits:
        return []
    return list(dict.fromkeys(sized(name, known[0].limits[name], t) for t in times))


def table(trials: Sequence[Trial], entry: Entry) -> str:
    """The table in Markdown, one row a trial."""
    rows = [f"| {' | '.join(HEAD)} |", f"|{'---|' * len(HEAD)}"]
    rows += [f"| {' | '.join(_row(t, entry.temperature))} |" for t in trials]
    return "\n".join(rows) + "\n"


def _row(trial: Trial, temperature: float) -> list[str]:
    scored = answer(trial).scored(temperature)
    name, right = trial.label, UNLISTED if trial.without else trial.label
    put = "nothing" if name == NONE else f"`{name}` {trial.effects[name]:g} {effect(name).magnitude.unit}"
    limit = trial.limits.get(name)
    share = f"{abs(trial.effects[name]) / limit:.1f}" if name in trial.effects and limit else "below it"
    found = trial.estimates.get(name)
    named = ", ".join(f"`{n}`" for n in trial.named) + (f" ({trial.gate})" if trial.gate else "")
    return [
        put + (", not in the library" if trial.without else ""),
        "" if name == NONE or trial.without else share,
        f"{trial.seed}",
        trial.verdict,
        named,
        f"{scored.probability[right]:.2f}" if right in scored.probability else "",
        "" if found is None else f"{found[0]:.3g}, {found[1]:.3g} to {found[2]:.3g}",
        "" if trial.closure is None else f"{trial.closure[0]:.2f}, {trial.closure[1]:.2f} to {trial.closure[2]:.2f}",
    ]


def summary(trials: Sequence[Trial], entry: Entry) -> str:
    """Counts: what was passed, named right, named wrong."""
    free = [t for t in trials if not t.effects]
    carrying = [t for t in trials if t.effects and not t.without]
    lacking = [t for t in trials if t.without]
    passed = sum(t.verdict == NONE_NEEDED for t in free)
    right = sum(t.verdict in (CAUSE, CLASS) and t.label in t.named for t in carrying)
    wrong = sum(t.verdict == CAUSE and t.label not in t.named for t in carrying)
    alarms = sum(_sure(t, entry.temperature) for t in free)
    told = sum(t.verdict == OUTSIDE for t in lacking)
    misled = sum(_sure(t, entry.temperature) for t in lacking)
    high = [t for t in carrying if np.isfinite(t.limits.get(t.label) or np.inf)]
    return (
        f"{len(free)} tests without effects: {passed} passed, {alarms} named at P ≥ {SURE}; {len(carrying)} with one "
        f"({len(high)} detectable): {right} named right, {wrong} wrong; {len(lacking)} with one that the library "
        f"lacks: {told} outside the library, {misled} named at P ≥ {SURE}"
    )


def _sure(trial: Trial, temperature: float) -> bool:
    """Whether a single cause is stated at P ≥ 0.8, whatever the gate says."""
    scored = answer(trial).scored(temperature)
    first = scored.ranked()[0]
    return trial.verdict != OUTSIDE and bool(names_of(first)) and scored.probability[first] >= SURE
