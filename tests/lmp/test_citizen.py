"""The bond style as LAMMPS knows styles: every law, restart, tables, hybrid, rerun, units, versions."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.lmp import plugin
from pipeline.lmp.law_table import coefficients
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.relaxation import Arms

from .bonds import FINITE, LENGTH, SMALL, chain, forces, rows

KN, FN, DN = 3.7e8, 71.0, 1.14e-4
PEAK = FN / KN
CENTRAL = f"{KN} {FN} {DN}"
MIXED = MixedSoftening(KN, 1e8, FN, 50.0, DN, 2e-4, friction=0.4)
ROUND_OFF = 1e-11  # of f_max: openings are differences of positions of 6e-4 m


@pytest.mark.parametrize("style", [SMALL, FINITE])
def test_opening_and_sliding_are_those_of_python(style: str) -> None:
    """The second particle is moved; what moves across a bond of finite kinematics slides by an arc."""
    state = MIXED.at_rest()
    path = (
        np.array([(0.5, 0.2), (40, 60), (20, 10), (-3, 90), (200, 300), (-5, 700), (-8, -900), (-6, 400), (1, 0)])
        * PEAK
    )
    with chain(coefficients(MIXED, 0), style) as lmp:
        for opening, sliding in path:
            moved = np.array([LENGTH + opening, sliding])
            if style == FINITE:
                distance, turn = LENGTH + opening, sliding / LENGTH
                moved = distance * np.array([np.cos(turn), np.sin(turn)])
            lmp.numpy.extract_atom("x")[1, :2] = moved
            row = rows(lmp)[0]
            at, slid = np.array([opening]), np.array([sliding])
            state = MIXED.advance(state, at, slid)
            normal, shear = (float(v[0]) for v in MIXED.forces(state, at, slid))
            lever = LENGTH / np.hypot(*moved) if style == FINITE else 1.0
            along = moved / np.hypot(*moved) if style == FINITE else np.array([1.0, 0.0])
            pull = normal * along + shear * lever * np.array([-along[1], along[0]])
            assert forces(lmp) == pytest.approx(np.array([pull, -pull]), abs=10 * ROUND_OFF * FN)
            torque = lmp.numpy.extract_atom("d_cohesive_torque")[:2]
            assert torque == pytest.approx(np.full(2, LENGTH / 2 * shear), abs=10 * ROUND_OFF * FN * LENGTH)
            assert row[[5, 7, 8]] == pytest.approx([normal, shear, state.used[0]], abs=10 * ROUND_OFF * FN)
            assert row[1] == pytest.approx(MIXED.stored(state, at, slid)[0], abs=10 * ROUND_OFF * FN * DN)


@pytest.mark.parametrize("angle", [0.0, 1.0])
def test_finite_rotation_of_bond_and_particles_together_does_nothing(angle: float) -> None:
    with chain(coefficients(MIXED, 0), FINITE, angle=angle) as lmp:
        turned = LENGTH * np.array([np.cos(angle + 0.1), np.sin(angle + 0.1)])
        lmp.numpy.extract_atom("x")[1, :2] = turned
        lmp.numpy.extract_atom("d_cohesive_theta")[:2] = 0.1
        lmp.command("run 0 post no")
        assert np.abs(forces(lmp)).max() < 1e-8 * FN  # asked for


def test_relaxation_and_creep_at_varying_steps_of_time() -> None:
    """Without a fix that says otherwise, bonds creep in the time of the simulation."""
    rise = Arms(np.array([[0.6 * KN, 0.3 * KN]]), np.array([[0.5, 20.0]]), np.array([0.1 * KN]))
    law = CreepingSoftening(rise, np.array([FN]), np.array([DN]))
    state = law.at_rest()
    path = [
        (0.9, 0.1),
        (0.9, 1.0),
        (0.9, 30.0),
        (1.2, 7.0),
        (0.2, 0.3),
        (3.0, 4.0),
        (90.0, 1.0),
        (-2.0, 5.0),
        (700.0, 1.0),
    ]
    with chain(coefficients(law, 0)) as lmp:
        for opening, duration in path:
            lmp.numpy.extract_atom("x")[1, 0] = LENGTH + opening * PEAK
            lmp.commands_string(f"timestep {duration}\nrun 1 pre no post no")
            at = np.array([opening * PEAK])
            state = law.advance(state, at, duration)
            force = law.force(state, at, 0.0)[0]
            assert forces(lmp)[0] == pytest.approx([force, 0], abs=10 * ROUND_OFF * FN)


@pytest.mark.parametrize("newton", ["newton on", "newton off"])
def test_history_is_written_and_read_as_a_table(newton: str, tmp_path: Path) -> None:
    far = np.array([0, LENGTH + 30 * PEAK, 2 * LENGTH + 200 * PEAK])
    near = far - np.array([0, 10, 40]) * PEAK
    found = []
    with chain(CENTRAL, count=3, before=newton) as lmp:
        for places in (far, near):
            lmp.numpy.extract_atom("x")[:3, 0] = places
            lmp.command("run 0 post no")
        found.append(forces(lmp, 3))
        lmp.command(f"cohesive/history write {tmp_path / 'own.txt'}")
        columns = "c_pairs[1] c_pairs[2] c_bond[10] c_bond[11] c_bond[12]"
        lmp.command(f"write_dump all local {tmp_path / 'dump.txt'} {columns} modify format float %.17g")
    for table in ("own.txt", "dump.txt"):
        with chain(CENTRAL, count=3, before=newton) as lmp:
            lmp.command(f"cohesive/history read {tmp_path / table}")
            lmp.numpy.extract_atom("x")[:3, 0] = near
            lmp.command("run 0 post no")
            found.append(forces(lmp, 3))
    assert np.abs(found[0]).max() > 1
    assert found[1] == pytest.approx(found[0], rel=1e-12)  # 17 digits carry a double
    assert found[2] == pytest.approx(found[0], rel=1e-12)  # so do these


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "ITEM: ENTRIES id1 id2 h1 h2 h3\n1 2 0.1 0.2\n",
            "line 2 holds 4 values, expected 5: id1 id2 and 3 of history",
        ),
        ("ITEM: ENTRIES id1 id2 h1 h2 h3\n1 2 0.1 0.2 x\n", "line 2: x is not a number"),
        ("ITEM: ENTRIES id1 id2 h1 h2 h3\n1 2 nan 6e-4 0\n", "line 2: nan is not a number"),
        ("ITEM: ENTRIES id1 id2 h1 h2 h3\n1 3 0 6e-4 0\n", "no cohesive bond between atoms 1 and 3"),
        ("ITEM: ENTRIES id1 id2 h1 h2 h3\n1 2000000000 0 6e-4 0\n", "no cohesive bond between atoms 1 and 2000000000"),
        ("ITEM: ENTRIES id1 id2 h1 h2 h3\n-1 2 0 6e-4 0\n", "no cohesive bond between atoms -1 and 2"),
        ("ITEM: ENTRIES id1 id2 h1 h2 h3\n1 2.5 0 6e-4 0\n", "line 2: 1 2.5 are not the ids of two atoms"),
        ("ITEM: ENTRIES id1 id2 h1 h2 h3\n1e300 2 0 6e-4 0\n", r"line 2: 1e\+300 2 are not the ids of two atoms"),
        (None, "cannot read"),
    ],
)
def test_a_faulty_table_is_refused(text: str | None, told: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "table.txt").write_text(text)
    with chain(CENTRAL, count=3) as lmp, pytest.raises(Exception, match=told):
        lmp.command(f"cohesive/history read {tmp_path / 'table.txt'}")


@pytest.mark.parametrize("law", [CENTRAL, coefficients(MIXED, 0), f"{CENTRAL} relax 2 0.5 1 0.5 30"])
def test_a_restart_brings_back_coefficients_and_history(law: str, tmp_path: Path) -> None:
    with chain(law) as lmp:
        for place in ((LENGTH + 50 * PEAK, 20 * PEAK), (LENGTH + 0.4 * PEAK, 10 * PEAK)):
            lmp.numpy.extract_atom("x")[1, :2] = place
            lmp.command("run 0 post no")
        expected = forces(lmp)
        lmp.command(f"write_restart {tmp_path / 'bond.restart'}")
    again = plugin.open_lammps()
    try:
        again.commands_string(
            f"atom_modify map array\nread_restart {tmp_path / 'bond.restart'}\npair_style none\n"
            "comm_modify cutoff 0.005\nneighbor 6e-4 bin\nrun 0 post no"
        )
        assert forces(again) == pytest.approx(expected, rel=1e-14)  # the same numbers
        again.command(f"write_data {tmp_path / 'bond.data'}")
    finally:
        again.close()
    assert f"1 {float(KN):.17g} {FN:.17g}" in (tmp_path / "bond.data").read_text()


@pytest.mark.parametrize("law", [CENTRAL, coefficients(MIXED, 0)])
def test_memory_goes_with_its_bond_where_another_is_deleted(law: str) -> None:
    """Without newton, the middle particles have two bonds each; the second takes the place of the first."""
    with chain(law, count=4, before="newton off") as lmp:
        for stretch in (90, 20):
            lmp.numpy.extract_atom("x")[2:4, 0] = (np.array([2, 3]) + stretch * PEAK / LENGTH) * LENGTH
            lmp.command("run 0 post no")
        expected = forces(lmp, 4)
        lmp.commands_string("group first id 1 2\ndelete_bonds first bond 1 remove special\nrun 0 post no")
        assert 0.1 * FN < expected[1, 0] < 0.9 * 20 * PEAK * KN, "the bond between 2 and 3 softened"
        assert forces(lmp, 4) == pytest.approx(expected, abs=ROUND_OFF * FN)  # of what is left the first had no force


@pytest.mark.parametrize("newton", ["newton on", "newton off"])
@pytest.mark.parametrize("style", [SMALL, FINITE])
@pytest.mark.parametrize("law", [CENTRAL, coefficients(MIXED, 0)], ids=["central", "sliding"])
def test_the_virial_is_the_derivative_of_the_energy(law: str, style: str, newton: str) -> None:
    """A softened and bent chain is strained as a whole: -W = dE/d(strain) for stretches along x and y."""
    with chain(law, style, count=4, angle=0.4, before=newton) as lmp:
        place = lmp.numpy.extract_atom("x")
        start = place[:4, :2].copy()
        bent = np.array([[0, 0], [1, 0.5], [0, 3], [-0.5, 1]]) * PEAK
        lmp.command("compute virial all pressure NULL bond")
        lmp.commands_string("thermo_style custom step pe vol c_virial[1]\nthermo_modify norm no")
        if law != CENTRAL:
            lmp.numpy.extract_atom("d_cohesive_theta")[:4] = np.array([1, -2, 3, 0]) * PEAK / LENGTH
        for size in (20.0, 8.0):
            place[:4, :2] = start + size * bent
            lmp.command("run 0 post no")
        now, area = place[:4, :2].copy(), lmp.get_thermo("vol")
        virial = lmp.numpy.extract_compute("virial", 0, 1)[:2] * area
        slope = np.zeros(2)
        for axis in (0, 1):
            for strain in (1e-6, -1e-6):
                place[:4, :2] = now
                place[:4, axis] *= 1 + strain
                lmp.command("run 0 post no")
                slope[axis] += lmp.get_thermo("pe") / (2 * strain)
        damage = rows(lmp)[:, 4]
        assert damage.max() > 0.1
        # energies are quadratic in the strain, but for arcs; what limits is the round-off of a difference of energies
        assert slope == pytest.approx(-virial, abs=1e-6 * np.abs(virial).max())


def test_what_bonds_remember_cannot_change_its_meaning() -> None:
    """Stiffness may change between runs; unloading may not where bonds slide, for D would be read as a way."""
    with chain(coefficients(MIXED, 0)) as lmp:
        lmp.command(f"bond_coeff 1 {coefficients(replace(MIXED, k_n=2 * MIXED.k_n), 0)}")
        with pytest.raises(Exception, match="unloading of bond type 1 cannot change between secant and elastic once"):
            lmp.command(f"bond_coeff 1 {coefficients(replace(MIXED, unloading='elastic'), 0)}")
    with chain(CENTRAL) as lmp:  # opening alone keeps delta_reached either way
        lmp.command(f"bond_coeff 1 {CENTRAL} unloading elastic")


@pytest.mark.parametrize("law", [CENTRAL, coefficients(MIXED, 0)], ids=["central", "sliding"])
def test_beside_another_style(law: str, tmp_path: Path) -> None:
    """Alone or in `hybrid`, before and after a restart; there LAMMPS keeps the history, not the coefficients."""
    hybrid = {"bonds": "bond_style hybrid harmonic cohesive", "coeff": "bond_coeff 1 cohesive"}
    other = "bond_coeff 2 harmonic 1.0 1.0"
    pulled = []
    for words in ({}, {**hybrid, "second": other, "style": ""}):
        with chain(law, **words) as lmp:
            for opening in (30, 12):
                lmp.numpy.extract_atom("x")[1, :2] = [LENGTH + opening * PEAK, 5 * PEAK]
                lmp.command("run 0 post no")
            pulled.append(forces(lmp))
            lmp.command(f"write_restart {tmp_path / 'hybrid'}")
    again = plugin.open_lammps()
    try:
        again.commands_string(
            f"atom_modify map array\nread_restart {tmp_path / 'hybrid'}\npair_style none\nneighbor 6e-4 bin\n"
            f"comm_modify cutoff 0.005\nbond_coeff 1 cohesive {law}\n{other}\nrun 0 post no"
        )
        pulled.append(forces(again))
    finally:
        again.close()
    assert 0.1 * FN < pulled[0][0, 0] < FN
    assert pulled[1] == pytest.approx(pulled[0], rel=1e-14)  # the same operations
    assert pulled[2] == pytest.approx(pulled[0], rel=1e-14)  # on the same numbers


def test_rerun_remembers_from_frame_to_frame(tmp_path: Path) -> None:
    with chain(CENTRAL) as lmp:
        lmp.command(f"dump path all custom 1 {tmp_path / 'path.dump'} id x y z")
        lmp.command("dump_modify path format float %.17g first yes")
        for step, opening in enumerate((0.5, 100.0, 20.0)):
            lmp.numpy.extract_atom("x")[1, 0] = LENGTH + opening * PEAK
            lmp.command("run 1 post no" if step == 0 else "run 1 pre no post no")
        expected = forces(lmp)
    with chain(CENTRAL) as lmp:
        lmp.command(f"rerun {tmp_path / 'path.dump'} dump x y")
        assert forces(lmp) == pytest.approx(expected, rel=1e-10)  # text of positions
        assert expected[0, 0] == pytest.approx(FN * (DN - 100 * PEAK) / (DN - PEAK) / 5, rel=1e-9)


@pytest.mark.parametrize("style", [SMALL, FINITE])
@pytest.mark.parametrize(
    ("units", "step"),
    [
        ("si", 1e-6),
        ("metal", 1e-4),
        ("real", 1e-1),
        ("lj", 1e-2),
        ("cgs", 1e-3),
        ("electron", 1e-2),
        ("micro", 1e-3),
        ("nano", 1e-3),
    ],
)
def test_energy_of_moving_and_turning_particles_is_kept(units: str, step: float, style: str) -> None:
    """Velocity Verlet of an elastic chain: whatever the units, energy turns round but is not lost."""
    with chain("100 inf inf shear 40 inf inf", style, count=4, units=units, length=1.0) as lmp:
        lmp.commands_string(
            f"thermo_modify norm no\ntimestep {step}\nfix move all cohesive/nve radius 0.5\nrun 0 post no"
        )
        lmp.numpy.extract_atom("x")[:4, :2] += 0.01 * np.array([[0, 0], [0.5, 1], [0, -1], [1, 0.5]])
        totals = []
        for _ in range(40):
            lmp.command("run 50 post no")
            kinetic = lmp.extract_fix("move", 0, 0)
            totals.append(lmp.get_thermo("pe") + lmp.get_thermo("ke") + kinetic)
        assert totals == pytest.approx(np.full(40, totals[0]), rel=2e-2)  # second order in the step
        assert lmp.extract_fix("move", 0, 0) > 0


def test_another_lammps_is_refused(tmp_path: Path) -> None:
    """In a process of its own: a library stays loaded."""
    library = plugin.library().read_bytes()
    assert b"22 Jul 2025" in library
    (tmp_path / plugin.LIBRARY).write_bytes(library.replace(b"22 Jul 2025", b"21 Jul 2024"))
    code = "import sys; from pipeline.lmp import plugin; plugin.folder = lambda: sys.argv[1]; plugin.open_lammps()"
    environment = os.environ | {"LAMMPS_PLUGIN_PATH": "", "PYTHONPATH": str(Path(plugin.__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], env=environment, capture_output=True, text=True, timeout=100
    )
    assert done.returncode != 0
    assert "compiled for LAMMPS 21 Jul 2024, this is 22 Jul 2025" in done.stdout + done.stderr
