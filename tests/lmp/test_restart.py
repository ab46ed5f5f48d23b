"""Restart files: of another format or other options they are refused; from any step a run goes on as if uncut."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement.test_steps import OTHERS, tiny_beam

from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.plugin import open_lammps

from .bonds import LENGTH, SMALL, chain

CENTRAL, SHEAR = "3.7e8 71.0 1.14e-4", "shear 1e8 50 2e-4"
NOW, DRIVE = 2.0, 3.0  # formats: of bond_style cohesive, of fix cohesive/drive


@pytest.fixture
def restart(tmp_path: Path) -> Path:
    """A restart file of a chain with a softened bond."""
    path = tmp_path / "bond.restart"
    with chain(CENTRAL, count=3) as lmp:
        lmp.numpy.extract_atom("x")[1, 0] = LENGTH + 3e-5
        lmp.command("run 0 post no")
        lmp.command(f"write_restart {path}")
    return path


def read_again(path: Path, *more: str) -> None:
    """Read a restart file and compute forces, with more commands in between."""
    lmp = open_lammps()
    try:
        setup = "pair_style none\ncomm_modify cutoff 0.005\nneighbor 6e-4 bin"
        lmp.commands_string("\n".join(["atom_modify map array", f"read_restart {path}", setup, *more, "run 0 post no"]))
    finally:
        lmp.close()


def stamped(path: Path, before: bytes, after: bytes) -> Path:
    """A copy in which bytes that occur once are others."""
    whole = path.read_bytes()
    assert whole.count(before) == 1
    other = path.with_name("other.restart")
    other.write_bytes(whole.replace(before, after))
    return other


@pytest.mark.parametrize("found", [0.0, 1.0, 3.0])
def test_bonds_of_another_format_are_refused(restart: Path, found: float) -> None:
    """Before formats had numbers, the kinematics stood first: 0 or 1."""
    read_again(restart)
    head = struct.pack("<3d", 0.0, np.nan, 3.0)  # small kinematics, no time, three values a bond
    other = stamped(restart, struct.pack("<d", NOW) + head, struct.pack("<d", found) + head)
    with pytest.raises(Exception, match=f"holds bond_style cohesive in format {found:g}, this version reads format 2"):
        read_again(other)


def test_other_options_than_before_are_refused(restart: Path) -> None:
    with pytest.raises(Exception, match=r"restart file holds 3 values a bond, these bond_coeff need 6: give them"):
        read_again(restart, f"bond_coeff * {CENTRAL} {SHEAR}")


def test_a_style_named_anew_knows_what_atoms_bring(restart: Path) -> None:
    """`bond_style` behind `read_restart` forgets what the file said of the style, not what it holds of the atoms."""
    read_again(restart, f"bond_style cohesive {SMALL}", f"bond_coeff * {CENTRAL}")
    with pytest.raises(Exception, match=r"brings a history of layout 2003002, here it is 2006002"):
        read_again(restart, f"bond_style cohesive {SMALL}", f"bond_coeff * {CENTRAL} {SHEAR}")


@contextmanager
def deck(begin: int = 0) -> Iterator[Any]:
    """The deck of this folder up to its output, ready to run."""
    setup, _, _ = Path(DECK).read_text().partition("fix             curve")
    Path("setup.lmp").write_text(setup)
    lmp = open_lammps()
    try:
        lmp.command(f"variable begin index {begin}")
        lmp.file("setup.lmp")
        yield lmp
    finally:
        lmp.close()


def told(lmp: Any) -> np.ndarray:
    """Everything that fix cohesive/drive tells."""
    return np.array([lmp.extract_fix("drive", 0, 1, k) for k in range(16)])


@pytest.mark.parametrize("name", ["plain", "sliding", "creep"])
def test_runs_may_be_cut_anywhere(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One run, two runs, and a restart between two records: the same bits."""
    record = write_deck(tmp_path, tiny_beam(accuracy=0.3, **OTHERS.get(name, {}))).record
    middle, end = 5 * record // 2, 6 * record
    monkeypatch.chdir(tmp_path)

    def after(*commands: str, begin: int = 0) -> np.ndarray:
        with deck(begin) as lmp:
            lmp.commands_list(list(commands))
            return told(lmp)

    whole = after(f"run {end} post no")
    cut = after(f"run {middle} post no", f"write_restart restart.{middle}", f"run {end} upto post no")
    again = after(f"run {end} upto post no", begin=middle)
    assert whole[0] > 0
    assert (cut == whole).all(), (cut, whole)
    assert (again == whole).all(), (again, whole)


def test_bonds_creep_by_the_simulation_once_the_drive_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Particles that nothing moves relax by the steps of the run; the time of the test before does not count."""
    problem = tiny_beam(accuracy=0.3, **OTHERS["creep"])
    write_deck(tmp_path, problem)
    monkeypatch.chdir(tmp_path)
    with deck() as lmp:
        lmp.commands_list(["run 300 post no", "compute still all bond/local force", "run 0 post no"])
        assert told(lmp)[15] > 1, "the test took some seconds so far"
        before = lmp.numpy.extract_compute("still", 2, 1).copy()
        lmp.commands_list(["unfix drive", "run 0 post no"])
        assert (lmp.numpy.extract_compute("still", 2, 1) == before).all(), "no time has passed"
        lmp.command("run 10 post no")  # of 1 s each
        after = lmp.numpy.extract_compute("still", 2, 1).copy()
        lmp.command("run 1000 post no")
        last = lmp.numpy.extract_compute("still", 2, 1)
    creeps = np.abs(after - before) > 1e-3 * np.abs(before).max()
    assert np.count_nonzero(creeps) > 20
    # of two decaying exponentials the slower is left, its time 194 s at most: e^(-1010/194) = 0.0055
    assert np.abs(last[creeps]).max() < 0.0055 * np.abs(before).max()


def test_a_drive_of_another_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_deck(tmp_path, tiny_beam(accuracy=0.3))
    monkeypatch.chdir(tmp_path)
    with deck() as lmp:
        lmp.commands_list(["run 50 post no", "write_restart written"])
        rate = told(lmp)[10]
    now, speed = struct.pack("<d", DRIVE), struct.pack("<d", rate)
    [line] = re.findall(re.escape(now) + b"(.{8})" + re.escape(speed), Path("written").read_bytes(), re.DOTALL)
    stamped(Path("written"), now + line + speed, struct.pack("<d", 0.0) + line + speed).rename("restart.50")
    with (
        pytest.raises(Exception, match="holds fix cohesive/drive in format 0, this version reads format 3"),
        deck(50),
    ):
        pass
