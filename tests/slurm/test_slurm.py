"""A study under a real SLURM: killed at its walltime, queued again, collected; .ci/run installs it and calls this."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from hpc.studies import bare_path, load_bundle, use_the_wheel

from pipeline.study.collect import collect
from pipeline.study.export import export
from pipeline.study.identify import identify
from slurm.loopback import Slurm, reason_to_skip

pytestmark = [pytest.mark.slow, pytest.mark.slurm]
GRID = (0.9, 1.0, 1.1)
SAME = 1e-8  # asked for; the same bits where both styles were compiled with the flags of CMakeLists.txt
WARNED, KILLED = 3, 4  # points that hang the first time: one is warned by USR1, one is killed at its walltime

# a LAMMPS that comes to its first restart file, then hangs: only its first start does
HANGING = """#!/bin/sh
lmp "$@" &
pid=$!
trap 'kill -CONT $pid; kill -TERM $pid; exit 1' TERM
while kill -STOP $pid 2>/dev/null; do
    sleep 0.2
    for file in restart.[0-9]*; do
        while [ -f "$file" ]; do sleep 1; done
    done
    kill -CONT $pid
    sleep 0.02
done
wait $pid
"""


@pytest.fixture
def slurm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Slurm]:
    if reason := reason_to_skip():
        pytest.skip(reason)
    running = None
    folder = tmp_path_factory.mktemp("slurm")
    try:
        running = Slurm(folder)
        yield running
    finally:
        (running or _half_started(folder)).end()


def _half_started(folder: Path) -> Slurm:
    """What is left of a SLURM that did not come up, so that it can be ended."""
    left = object.__new__(Slurm)
    left.folder, left.environment = folder, {}
    return left


def test_walltime_kill_requeue_and_collect_give_the_local_fit(slurm: Slurm, tmp_path: Path) -> None:
    bundle, study = load_bundle(tmp_path / "bundle"), tmp_path / "study"
    export(bundle, study, grid=GRID, walltime_min=1, restart_steps=500, partition="debug")
    use_the_wheel(study)
    (study / "hang").write_text(HANGING)
    hang = f'case "${{SLURM_RESTART_COUNT:-0}}$point" in 0000{WARNED}|0000{KILLED}) LMP="sh $here/hang";; esac\n'
    with (study / "environment").open("a") as file:
        file.write(f"PATH={bare_path(tmp_path / 'bin')}:$PATH\n{hang}")
    others = [n for n in range(9) if n != KILLED]
    words = ("sbatch", "--parsable", f"--chdir={study}")
    # without the warning of submit.slurm this point runs into its walltime
    killed = slurm.ask(*words, f"--array={KILLED}", "--signal=B:URG@1", study / "submit.slurm").strip()
    first = slurm.ask(*words, f"--array={','.join(map(str, others))}", study / "submit.slurm").strip()

    slurm.wait_for(lambda: slurm.sound_states()[f"{killed}_{KILLED}"] == "TIMEOUT", 200)
    assert "DUE TO TIME LIMIT" in (study / f"slurm-{KILLED:04d}.log").read_text()
    [restart] = (study / f"points/{KILLED:04d}").glob("restart.[0-9]*")
    assert not (study / f"points/{KILLED:04d}/results.sha256").exists()
    slurm.ask("scontrol", "requeue", f"{killed}_{KILLED}")
    slurm.wait_for(lambda: set(slurm.sound_states().values()) == {"COMPLETED"}, 200)
    assert len(slurm.states()) == 9
    for number in (WARNED, KILLED):
        log = (study / f"slurm-{number:04d}.log").read_text()
        assert f"point {number:04d} from step 0 on" in log
        assert f"point {number:04d} is done" in log
    assert f"from step {restart.suffix[1:]} on" in (study / f"slurm-{KILLED:04d}.log").read_text()
    assert first != killed

    collect(study, workers=2)
    identify(bundle, tmp_path / "here", grid=GRID, workers=2)
    here, there = (json.loads((folder / "result.json").read_text()) for folder in (tmp_path / "here", study))
    for name in ("f_max_n", "delta_max_m"):
        assert there[name] == pytest.approx(here[name], rel=SAME)
