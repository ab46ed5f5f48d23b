"""Stock approximations: peak force and energy of a bond are those of the law, and a specimen breaks much as it does."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.problem import Problem
from pipeline.lmp import ranks
from pipeline.lmp.law_table import law_table
from pipeline.lmp.simulate import solve
from pipeline.lmp.stock import STOCK_DECK, bond_tables, read_stock_solution, solve_stock, write_stock_deck


@pytest.fixture(scope="module")
def coarse() -> Problem:
    return small_beam(2e-3, stones=False, cmod_max=0.25e-3, accuracy=0.03)


def test_a_table_has_the_strength_and_energy_of_the_law(coarse: Problem) -> None:
    table = law_table(coarse)
    length = 2 * coarse.particles.radius
    text = bond_tables(table, length, 1e-3)
    for part, row in zip(text.split("KIND")[1:], table.rows, strict=True):
        rows = np.array([line.split() for line in part.splitlines()[3:] if line], float)
        opening, energy, force = rows[:, 1] - length, rows[:, 2], -rows[:, 3]
        assert np.diff(opening).min() > 1e-9, "rows that nearly coincide throw the spline of LAMMPS off"
        k_n, f_max, delta_max = row[:3]
        assert force[opening < 0] == pytest.approx(k_n * opening[opening < 0], rel=1e-9)  # elastic in compression
        if np.isfinite(f_max):
            assert force.max() == pytest.approx(f_max, rel=1e-6)  # the peak is a row, to round-off of the length
            # trapezoids over 0.3 µm rows around the end of the line
            assert energy[-1] == pytest.approx(f_max * delta_max / 2, rel=1e-3)
            assert abs(force[opening > delta_max + 1e-9]).max() < 1e-6 * f_max


def test_plastic_bonds_have_the_strength_and_energy_of_the_law(coarse: Problem, tmp_path: Path) -> None:
    write_stock_deck(tmp_path, coarse, kind="plastic")
    length = 2 * coarse.particles.radius
    lines = re.findall(r"^bond_coeff \d+ (\S+) (\S+) 0\.0 (\S+)", (tmp_path / "bonds.inc").read_text(), re.MULTILINE)
    for line, row in zip(lines, law_table(coarse).rows, strict=True):
        k_n, part, give = map(float, line)
        if np.isfinite(row[1]):
            assert k_n * give * length == pytest.approx(row[1], rel=1e-12)
            assert k_n * give * length * (part - give / 2) * length == pytest.approx(row[1] * row[2] / 2, rel=1e-12)


def test_tabulated_bonds_break_a_beam_much_as_the_law_does(coarse: Problem) -> None:
    cmod = np.linspace(0.02, 0.24, 30) * 1e-3
    ours, stock = solve(coarse), solve_stock(coarse)
    apart = np.linalg.norm(stock.curve.load_at(cmod) - ours.curve.load_at(cmod))
    # both runs ask for 3 %; measured 2.4 % at 1 % asked for (docs/stock.md)
    assert apart < 0.06 * np.linalg.norm(ours.curve.load_at(cmod))
    assert stock.energy.dissipated == pytest.approx(ours.energy.dissipated, rel=0.06)
    assert stock.cmod == pytest.approx(coarse.stations)


def test_a_restart_goes_on_alike(coarse: Problem, tmp_path: Path) -> None:
    whole, halves = tmp_path / "whole", tmp_path / "halves"
    for folder in (whole, halves):
        folder.mkdir()
        write_stock_deck(folder, coarse, 1000)
    ranks.run(whole, 1, deck=STOCK_DECK)
    deck = (halves / STOCK_DECK).read_text()
    (halves / STOCK_DECK).write_text(
        deck.replace("${steps_max} upto", "3200 upto").replace(">= ${steps_max}", ">= 3200")
    )
    ranks.run(halves, 1, deck=STOCK_DECK)
    [restart] = halves.glob("restart.*")
    (halves / STOCK_DECK).write_text(deck)
    ranks.run(halves, 1, "-var", "begin", restart.suffix[1:], deck=STOCK_DECK)
    one, two = (read_stock_solution(coarse, folder, 0.0) for folder in (whole, halves))
    scale = one.curve.load.max()
    assert two.curve.load == pytest.approx(one.curve.load, abs=1e-8 * scale)  # asked for; the same bits here
    assert two.displacement == pytest.approx(one.displacement, abs=1e-8 * abs(one.displacement).max())
