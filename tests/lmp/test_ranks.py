"""One simulation on MPI ranks: the results of one process; a rank that is killed is lost, not at fault."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.errors import InputError, PipelineError, ProcessLostError
from pipeline.core.problem import Problem
from pipeline.lmp.deck import write_deck
from pipeline.lmp.ranks import run, solve_on_ranks
from pipeline.lmp.simulate import solve
from pipeline.study.engines import engine


@pytest.fixture(scope="module")
def short() -> Problem:
    return small_beam(2e-3, stones=False, cmod_max=0.05e-3, accuracy=0.05)


def test_one_rank_gives_the_bits_of_this_process(short: Problem) -> None:
    here, there = solve(short), solve_on_ranks(short, 1)
    assert (there.curve.load == here.curve.load).all()
    assert (there.displacement == here.displacement).all()
    assert (there.reached == here.reached).all()


def test_two_ranks_give_the_same_to_1e_8(short: Problem) -> None:
    one, two = solve(short), solve_on_ranks(short, 2)
    assert two.curve.load == pytest.approx(one.curve.load, abs=1e-8 * one.curve.load.max())  # the order of sums differs
    assert two.displacement == pytest.approx(one.displacement, abs=1e-8 * np.abs(one.displacement).max())


def lammps_in(folder: Path) -> list[int]:
    """Processes of LAMMPS that work in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if Path(os.readlink(process / "cwd")) == folder and Path(os.readlink(process / "exe")).name == "lmp":
                found.append(int(process.name))
    return found


def test_a_killed_lammps_is_lost_and_not_at_fault(tmp_path: Path) -> None:
    folder = tmp_path.resolve()
    write_deck(folder, small_beam(accuracy=0.0005))

    def kill() -> None:
        end = time.monotonic() + 30
        while not lammps_in(folder) and time.monotonic() < end:
            time.sleep(0.02)
        for pid in lammps_in(folder):
            os.kill(pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(ProcessLostError, match="LAMMPS was killed by signal 9"):
        run(folder, 1)
    killer.join()


def test_an_error_of_lammps_is_told(short: Problem, tmp_path: Path) -> None:
    write_deck(tmp_path, short)
    (tmp_path / "bonds.inc").write_text("bond_coeff 1 -1 1 1\n")
    with pytest.raises(PipelineError, match=r"LAMMPS on 1 ranks stopped in .*: ERROR.*k_n = -1 N/m") as caught:
        run(tmp_path, 1)
    assert not isinstance(caught.value, ProcessLostError), "the same would happen again"


def test_ranks_that_make_no_sense_are_refused(short: Problem) -> None:
    with pytest.raises(InputError, match="ranks = 0 must be at least 1"):
        solve_on_ranks(short, 0)
    with pytest.raises(InputError, match="engine equilibrium runs in one process"):
        engine("equilibrium", 2)
    assert engine("lammps", 2).label == engine("lammps").label, "kept under the same key"
