"""Make sealed tests with engine C: anonymous bundles in OUT/bundles, the truth locked in OUT.vault."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.blind.sample import PHYSICS
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.execution.here import Here
from pipeline.execution.processes import LocalProcesses
from pipeline.execution.progress import Progress, Silent
from pipeline.store.atomic import write_atomically
from pipeline.store.results import prepare_output
from pipeline.study.blind_check.cases import SIZES, Case, drawn_cases
from pipeline.study.blind_check.limits import Limits, finite_or_none, limits_of
from pipeline.study.blind_check.recording import write_case
from pipeline.study.blind_check.seal import BUNDLES, PLAN, SEAL, canonical, lock, salted, vault_of, write_seal
from pipeline.study.blind_check.specimens import Drawn, crack, draw

BEGUN = "begun.json"  # in the vault
LOST = 0.1  # share of the tests that may turn out not to be breakable


def make(
    out: Path,
    *,
    size: str = "small",
    seed: int = 0,
    limits: Path | None = None,
    workers: int = 1,
    progress: Progress | None = None,
) -> str:
    """Break the cases of a check and seal them; goes on where it stopped.

    Parameters
    ----------
    out : folder; its vault is OUT.vault
    size : "small" or "full"
    seed : of specimens, truth, cases and noise
    limits : result.json of a diagnosis whose detection limits scale the effects; without it those that ship
    workers : specimens that are broken at a time

    Raises
    ------
    InputError
        where OUT is sealed already, or was begun with another size, seed or limits
    """
    out, progress = Path(out).resolve(), progress or Silent()
    vault, chosen = vault_of(out), SIZES[size]
    if (out / SEAL).exists():
        raise InputError(f"{out} is sealed already: run and open it, or choose another folder")
    for folder in (out / BUNDLES, vault):
        prepare_output(folder)
    known = limits_of(limits, chosen.specimens[0], chosen.radius_mm)
    _begun(vault, {"size": size, "seed": seed, "limits": known.told(), "version": __version__})
    job = Job(out, size, seed, known)
    cases = job.cases()
    progress.stage(f"breaking {len(cases)} tests")
    ready = [c.name for c in cases if _ready(out, c)]
    progress.begin(len(cases), len(ready), "test")
    lost = _broken_all(job, [names for names in _groups(cases) if not set(names) <= set(ready)], workers, progress)
    cases = kept([c for c in cases if c.name not in lost])
    specimens = job.specimens()
    rows = {case.name: truth_row(case, specimens[case.specimen], known.value) for case in cases}
    truth = salted({"format": 1, "size": size, "seed": seed, "version": __version__, "cases": rows})
    (out / PLAN).write_bytes(canonical({c.name: planned(c) for c in cases}))
    lock(truth, vault)
    made = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    write_seal(out, truth, vault, {"size": size, "made": made, "left_out": lost, "detection_limits": known.told()})
    told = f"{len(cases)} sealed tests; their truth lies locked in {vault.name}"
    if lost:
        told += f"; {len(lost)} more were drawn that cannot be broken: {'; '.join(sorted(set(lost.values())))}"
    stale = known.source.get("by_library_in_use") is False
    return told + ("; the detection limits are of another library: see scripts/blind_limits.py" if stale else "")


@dataclass(frozen=True)
class Job:
    """What is made: everything follows from it, in whatever process."""

    out: Path
    size: str
    seed: int
    limits: Limits

    def _rng(self, number: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, number])

    def cases(self) -> list[Case]:
        return drawn_cases(self.size, self.limits.value, self._rng(0))

    def specimens(self) -> list[Drawn]:
        """All specimens before they are tested."""
        geometries = SIZES[self.size].specimens
        states = self._rng(1).spawn(len(geometries))
        return [draw(g, SIZES[self.size], state) for g, state in zip(geometries, states, strict=True)]

    def write(self, names: Sequence[str]) -> list[str]:
        """Break one specimen and write the cases that are records of it; returns those that were not there yet."""
        cases, chosen = self.cases(), SIZES[self.size]
        streams = dict(zip([c.name for c in cases], self._rng(2).spawn(len(cases)), strict=True))
        wanted = [c for c in cases if c.name in names and not _ready(self.out, c)]
        drawn = self.specimens()[wanted[0].specimen]
        broken = crack(wanted[0], drawn, chosen, self.seed)
        for case in wanted:
            write_case(self.out / BUNDLES / case.name, case, drawn, broken, chosen, streams[case.name])
        return [case.name for case in wanted]


def kept(cases: Sequence[Case]) -> list[Case]:
    """The cases; of a set of replicates that has one member left this is a test like any other."""
    members = Counter(c.replicates for c in cases)
    return [replace(c, replicates="") if c.replicates and members[c.replicates] == 1 else c for c in cases]


def _ready(out: Path, case: Case) -> bool:
    return (out / BUNDLES / case.name / "experiment.toml").exists()


def _groups(cases: Sequence[Case]) -> list[list[str]]:
    """Cases that are records of one broken specimen."""
    found: dict[tuple[Any, ...], list[str]] = {}
    for case in cases:
        found.setdefault(_same(case), []).append(case.name)
    return list(found.values())


def _broken_all(job: Job, groups: Sequence[Sequence[str]], workers: int, progress: Progress) -> dict[str, str]:
    """Break all specimens; each in a process of its own where there are several workers.

    Returns
    -------
    case → why it cannot be broken on any mesh

    Raises
    ------
    ConvergenceError
        at the end, where these are more than `LOST`; what could be broken is kept
    """
    lost: dict[str, str] = {}
    own = Here() if workers == 1 else LocalProcesses(workers)
    try:
        under_way = {own.submit(job.write, names): names for names in groups}
        for future in as_completed(under_way):
            if isinstance(error := future.exception(), ConvergenceError):
                lost |= dict.fromkeys(under_way[future], str(error))
                continue
            for name in future.result():
                progress.done(name)
    finally:
        if isinstance(own, LocalProcesses):
            own.kill()
    if len(lost) > LOST * len(job.cases()):
        raise ConvergenceError(
            f"{len(lost)} tests cannot be broken, more than {LOST:.0%}; take another seed: {next(iter(lost.values()))}"
        )
    return lost


def _begun(vault: Path, asked: dict[str, Any]) -> None:
    """Write down what is made; refuse to go on with something else."""
    file = vault / BEGUN
    if not file.exists():
        write_atomically(file, canonical(asked))
    elif file.read_bytes() != canonical(asked):
        raise InputError(
            f"{vault.with_suffix('').name} was begun with another size, seed, limits or version: go on with these, or "
            "choose another folder"
        )


def planned(case: Case) -> dict[str, Any]:
    """What `run` must know of a case."""
    return {"without": list(case.without)} | ({"replicates": case.replicates} if case.replicates else {})


def truth_row(case: Case, drawn: Drawn, limits: Mapping[str, float]) -> dict[str, Any]:
    """What the truth table says of a case."""
    return {
        "specimen": f"specimen-{case.specimen}",
        "geometry": case.geometry,
        "kind": case.kind,
        "effects": dict(case.effects),
        "stranger": None if case.stranger is None else {case.stranger[0]: case.stranger[1]},
        "without": list(case.without),
        "replicates": case.replicates,
        "multiple": case.multiple,
        "detection_limit": {n: finite_or_none(limits[n]) for n in case.effects},
        "noise": case.noise,
        "images": case.images,
        "f_max_n": drawn.f_max,
        "delta_max_m": drawn.delta_max,
    }


def _same(case: Case) -> tuple[Any, ...]:
    """Cases with the same key are records of one broken specimen."""
    physics = tuple(sorted((n, v) for n, v in case.effects.items() if n in PHYSICS))
    return case.specimen, physics, case.stranger or ()
