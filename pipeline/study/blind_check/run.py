"""Diagnose every sealed bundle and seal the verdicts before anybody opens the truth."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.core.errors import InputError, PipelineError, StoreError
from pipeline.execution.processes import THREADS
from pipeline.execution.progress import Progress, Silent
from pipeline.store.atomic import write_atomically
from pipeline.store.results import RESULT, plain, prepare_output
from pipeline.study.blind_check.looks import LOOKS, write_strips
from pipeline.study.blind_check.seal import (
    BUNDLES,
    OPENED,
    PLAN,
    SEAL,
    VERDICT_SEAL,
    VERDICTS,
    canonical,
    code_digest,
    digest,
    file_digests,
    read_json,
)

DIAGNOSE, LOOK = (f"pipeline.study.blind_check.judging:{name}" for name in ("diagnose", "look"))
DIAGNOSES, SIMULATIONS, SCRATCH = "diagnoses", "simulations", "scratch"
LOG, SECONDS = "log.txt", "seconds.json"
TOGETHER = 4  # bundles that one process looks at


def run(
    out: Path,
    *,
    diagnose: str = DIAGNOSE,
    seed: int = 0,
    workers: int = 1,
    prefix: Sequence[str] = (),
    progress: Progress | None = None,
) -> str:
    """Diagnose the bundles of OUT, each in a process of its own; goes on where it stopped; then seals.

    Parameters
    ----------
    out : folder of `make`, or with bundles/, plan.json (optional) and seal.json of another program
    diagnose : "module:function" with the signature of `study.diagnose.diagnose`
    seed : of the diagnoses
    workers : diagnoses at a time
    prefix : words before the command of every process, such as a tracer's

    Raises
    ------
    InputError
        where the truth was opened already
    StoreError
        where the bundles are not the sealed ones
    """
    out, progress = Path(out).resolve(), progress or Silent()
    if (out / OPENED).exists():
        raise InputError(f"{out} was opened: verdicts after that are worth nothing; make a new check with another seed")
    seal = read_json(out / SEAL)
    if file_digests(out / BUNDLES) != seal["bundles_sha256"]:
        raise StoreError(f"the bundles of {out} are not those that were sealed: make the check again")
    plan = read_json(out / PLAN) if (out / PLAN).exists() else {}
    names = sorted(path.name for path in (out / BUNDLES).iterdir() if path.is_dir())
    sets = replicates(plan, names)
    if diagnose == DIAGNOSE:
        _looked_at(out, names, workers, prefix, progress)
    tasks = [*sets.items(), *((name, [name]) for name in names)]
    done = [name for name, _ in tasks if _found(out, name) is not None]
    progress.stage(f"diagnosing {len(names)} sealed bundles" + (f", {len(sets)} sets of replicates" if sets else ""))
    progress.begin(len(tasks), len(done), "diagnosis")

    def judge(task: tuple[str, list[str]]) -> str | None:
        return _diagnosed(out, *task, plan.get(task[1][0], {}).get("without", ()), diagnose, seed, prefix)

    for chosen in (sets, {name: [name] for name in names}):  # sets first: they leave the verdicts of their members
        wanted = [(name, members) for name, members in chosen.items() if _found(out, name) is None]
        with ThreadPoolExecutor(workers) as pool:  # each thread waits for a process
            for (name, _), failure in zip(wanted, pool.map(judge, wanted), strict=True):
                if failure is None:
                    progress.done(name)
                else:
                    progress.failed(name, PipelineError(failure))
    return _sealed(out, names, list(sets))


def _looked_at(out: Path, names: Sequence[str], workers: int, prefix: Sequence[str], progress: Progress) -> None:
    """Find what tests of one specimen share; images are correlated for it. A bundle that fails here shares nothing."""
    missing = [name for name in names if not (out / LOOKS / f"{name}.json").exists()]
    progress.stage(f"looking at {len(names)} sealed bundles")
    progress.begin(len(names), len(names) - len(missing), "bundle")

    def looked(part: Sequence[str]) -> None:
        folder = prepare_output(out / LOOKS / f"part-{part[0]}")
        bundles = os.pathsep.join(str(out / BUNDLES / name) for name in part)
        _guarded(out, [bundles, str(out), "0", "", LOOK], folder, prefix)
        for name in part:
            progress.done(name)

    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(looked, [missing[k : k + TOGETHER] for k in range(0, len(missing), TOGETHER)]))
    write_strips(out, names)


def replicates(plan: Mapping[str, Any], names: Sequence[str]) -> dict[str, list[str]]:
    """Sets of bundles that are diagnosed together, as the plan says.

    Raises
    ------
    StoreError
        where a set has the name of a bundle, or bundles of one set are to be judged by different libraries
    """
    found: dict[str, list[str]] = {}
    for name in names:
        label = plan.get(name, {}).get("replicates")
        if label:
            found.setdefault(str(label), []).append(name)
    for label, members in found.items():
        libraries = {tuple(plan[name].get("without", ())) for name in members}
        if label in names or len(libraries) > 1:
            raise StoreError(f"the plan's set {label!r} has a bundle's name, or members with different libraries")
    return {label: members for label, members in sorted(found.items()) if len(members) > 1}


def _found(out: Path, name: str) -> dict[str, Any] | None:
    path = out / DIAGNOSES / name / RESULT
    return read_json(path) if path.exists() else None


def _folder(out: Path, name: str) -> Path:
    """Of one diagnosis; tests of one specimen at the same stations share their simulations."""
    folder = prepare_output(out / DIAGNOSES / name)
    shared = folder / SIMULATIONS
    if not shared.exists():
        prepare_output(out / SIMULATIONS)
        shared.symlink_to(out / SIMULATIONS, target_is_directory=True)
    return folder


def _diagnosed(
    out: Path,
    name: str,
    members: Sequence[str],
    without: Sequence[str],
    diagnose: str,
    seed: int,
    prefix: Sequence[str],
) -> str | None:
    """Run one diagnosis of one bundle or of several; why it failed, or None."""
    folder = _folder(out, name)
    for member in members if len(members) > 1 else ():
        if not (folder / member).exists():
            (folder / member).symlink_to(_folder(out, member), target_is_directory=True)
    bundles = os.pathsep.join(str(out / BUNDLES / member) for member in members)
    code = _guarded(out, [bundles, str(folder), str(seed), ",".join(without), diagnose], folder, prefix)
    if code == 0 and (folder / RESULT).exists():
        return None
    return _last_line(folder / LOG) or f"the process ended with {code} and no result"


def _guarded(out: Path, asked: Sequence[str], folder: Path, prefix: Sequence[str]) -> int:
    """Run the guard in a process of its own, its words and seconds into a folder; returns its code."""
    scratch = str(prepare_output(out / SCRATCH))
    command = [*prefix, sys.executable, "-m", "pipeline.study.blind_check.guard", str(out), *asked]
    root = str(Path(__file__).resolve().parents[3])
    paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    settings = {"TMPDIR": scratch, "MPLCONFIGDIR": scratch, "HOME": scratch, "PYTHONPATH": paths, "MPLBACKEND": "Agg"}
    settings["PYTHONDONTWRITEBYTECODE"] = "1"
    settings |= dict.fromkeys(THREADS, "1")  # as many diagnoses at a time as there are workers
    return _timed(command, out, os.environ | settings, folder)


def _timed(command: Sequence[str], out: Path, settings: Mapping[str, str], folder: Path) -> int:
    """Run a process, its words into the log and its seconds into a file; returns its code."""
    began = time.monotonic()
    with (folder / LOG).open("wb") as log:
        process = subprocess.Popen(command, cwd=out, env=settings, stdout=log, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(process.pid, 0)  # with what its own children used
    process.returncode = code = os.waitstatus_to_exitcode(status)
    taken = {"seconds": time.monotonic() - began, "processor_seconds": used.ru_utime + used.ru_stime}
    write_atomically(folder / SECONDS, canonical(taken))
    return code


def _sealed(out: Path, names: Sequence[str], sets: Sequence[str]) -> str:
    """Write all verdicts into one file, and its digest with the code's beside it."""
    found = {name: _found(out, name) for name in names}
    missing = [name for name, result in found.items() if result is None]
    together = {name: _found(out, name) for name in sets}
    missing += [name for name, result in together.items() if result is None]
    table: dict[str, dict[str, Any]] = {
        "verdicts": {n: r for n, r in found.items() if r is not None},
        "together": {n: r for n, r in together.items() if r is not None},
        "failed": {name: _why(out, name) for name in missing},
        "seconds": {name: row for name in (*names, *sets) if (row := _taken(out, name))},
    }
    content = canonical(table)
    write_atomically(out / VERDICTS, content)
    seal = {
        "verdicts_sha256": digest(content),
        "seal_sha256": digest((out / SEAL).read_bytes()),
        "version": __version__,
        "code_sha256": code_digest(),
        "sealed": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }
    write_atomically(out / VERDICT_SEAL, canonical(plain(seal)))
    told = f"; {len(missing)} failed: {', '.join(missing)} (logs in {DIAGNOSES})" if missing else ""
    return f"{len(table['verdicts']) + len(table['together'])} verdicts sealed{told}"


def _why(out: Path, name: str) -> str:
    return _last_line(out / DIAGNOSES / name / LOG) or "it was not run"


def _last_line(log: Path) -> str:
    lines = log.read_text("utf-8", errors="replace").strip().splitlines() if log.exists() else []
    return lines[-1] if lines else ""


def _taken(out: Path, name: str) -> dict[str, Any] | None:
    path = out / DIAGNOSES / name / SECONDS
    return read_json(path) if path.exists() else None
