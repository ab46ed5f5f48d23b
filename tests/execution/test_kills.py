"""SIGKILL of the main process, of a worker, of LAMMPS, at random moments: what is resumed is what was never stopped."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from execution.real_engine import problems
from helpers.commands import workers

COUNT = 45
CLOCK = ("seconds",)


def start(folder: Path) -> subprocess.Popen[bytes]:
    """The simulations as a command of its own."""
    paths = os.pathsep.join(path for path in sys.path if path)
    line = [sys.executable, "-m", "execution.real_engine", str(folder), str(COUNT)]
    quiet = subprocess.DEVNULL
    environment = os.environ | {"PYTHONPATH": paths}
    return subprocess.Popen(line, env=environment, start_new_session=True, stdout=quiet, stderr=quiet)


def children(pid: int) -> list[int]:
    """Processes that a process has started, and those that they have."""
    found = []
    for tasks in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            own = [int(child) for child in tasks.read_text().split()]
        except OSError:  # it has just ended
            own = []
        found += own + [one for child in own for one in children(child)]
    return found


def lammps(pid: int) -> list[int]:
    """The LAMMPS processes below a process."""
    found = []
    for child in children(pid):
        try:
            if Path(os.readlink(f"/proc/{child}/exe")).name == "lmp":
                found.append(child)
        except OSError:
            continue
    return found


def kept(folder: Path) -> dict[str, tuple[int, int]]:
    """Every kept simulation: inode and time of its file, which change when it is written again."""
    return {p.name: (p.stat().st_ino, p.stat().st_mtime_ns) for p in (folder / "kept").glob("*.h5")}


def content(folder: Path) -> dict[str, dict[str, bytes]]:
    """All numbers of all simulations but the processor time they took."""
    found = {}
    for path in sorted((folder / "kept").glob("*.h5")):
        with h5py.File(path) as file:
            names: list[str] = []
            file.visititems(
                lambda name, item, names=names: names.append(name) if isinstance(item, h5py.Dataset) else None
            )
            found[path.name] = {n: np.asarray(file[n][()]).tobytes() for n in names if n not in ("seconds", "checksum")}
    return found


@pytest.mark.slow
def test_twenty_kills_change_no_bit_and_lose_nothing(tmp_path: Path) -> None:
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert start(whole).wait(300) == 0
    draw, main = random.Random(6), start(broken)
    log: list[str] = []
    before: dict[str, tuple[int, int]] = {}
    kinds = draw.sample(["main", "worker", "lammps"] * 7, 21)[:20]
    while len(log) < 20:
        if main.poll() is not None:  # killed, or given up what was lost twice: the same command goes on
            assert main.returncode in (-signal.SIGKILL, 1)
            main = start(broken)
        assert len(kept(broken)) < COUNT, f"all was finished after {len(log)} kills: {log}"
        kind = kinds[len(log)]
        targets = {"main": [main.pid], "worker": workers(main.pid), "lammps": lammps(main.pid)}[kind]
        if not targets or not workers(main.pid):  # it is still starting, or reads what is kept
            time.sleep(0.02)
            continue
        time.sleep(draw.uniform(0.0, 0.5))
        try:
            os.kill(draw.choice(targets), signal.SIGKILL)
        except ProcessLookupError:  # it has just ended
            continue
        log.append(kind)
        if kind == "main":
            main.wait(10)
        now = kept(broken)
        assert {name: now.get(name) for name in before} == before, "what was finished is neither lost nor run again"
        before = now
    while main.wait(300) != 0:
        main = start(broken)
    assert set(log) == {"main", "worker", "lammps"}
    assert {name: kept(broken)[name] for name in before} == before
    assert content(broken) == content(whole), "the same bits"
    assert sorted(content(whole)) == sorted(f"{key}.h5" for key in problems(COUNT))
    for name, (_, finished) in kept(broken).items():
        for begun in (broken / "starts").glob(f"{name.removesuffix('.h5')}.*"):
            assert int(begun.name.split(".")[2]) < finished, "no simulation was started after it had been kept"
    print(f"{len(log)} kills: {log}; starts: {len(list((broken / 'starts').iterdir()))} for {COUNT} simulations")
