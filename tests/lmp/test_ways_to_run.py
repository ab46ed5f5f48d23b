"""Every law through softening, however it is run: ranks, threads, newton, sorting, rebuilding, restarts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from agreement.test_steps import OTHERS, tiny_beam

from pipeline.core.problem import Problem
from pipeline.core.units import MM
from pipeline.lmp.deck import DECK, write_deck
from pipeline.lmp.output import read_curve

from .test_simulate import SAME, run_deck

pytestmark = pytest.mark.slow

Edit = Callable[[str], str]
NEWTON_ON: Edit = lambda deck: deck.replace("newton          off", "newton          on")  # noqa: E731
SORTED: Edit = lambda deck: deck.replace("sort 0 0.0", "sort 100 0.002")  # noqa: E731
REBUILT: Edit = lambda deck: deck.replace("every 100 delay 0 check yes", "every 50 delay 0 check no")  # noqa: E731
TWO_THREADS = ("-pk", "omp", "2")
WAYS: dict[str, tuple[int, tuple[str, ...], Edit]] = {
    "newton on": (1, (), NEWTON_ON),
    "sorted every 100": (1, (), lambda deck: SORTED(REBUILT(deck))),
    "rebuilt every 50": (1, (), REBUILT),
    "two threads": (1, TWO_THREADS, str),
    "two threads, newton on": (1, TWO_THREADS, NEWTON_ON),
    "two ranks": (2, (), str),
    "two ranks, newton on, rebuilt": (2, (), lambda deck: NEWTON_ON(REBUILT(deck))),
    "four ranks": (4, (), str),  # on two processors up to three minutes, seen beside fourteen other processes
}
LAWS = {"plain": {}, "sliding": OTHERS["sliding"], "creep": OTHERS["creep"]}


@pytest.fixture(scope="module", params=LAWS)
def broken(request: pytest.FixtureRequest) -> Problem:
    """A beam of 294 particles, far behind its peak after some 600 steps."""
    return tiny_beam(accuracy=0.3, cmod_max=0.15 * MM, **LAWS[request.param])


@pytest.fixture(scope="module")
def record(broken: Problem, tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """What one rank with one thread records, with bonds that break."""
    folder = tmp_path_factory.mktemp("one")
    write_deck(folder, broken)
    run_deck(folder)
    found = read_curve(folder / "curve.txt")
    assert found["load_n"][-1] < 0.5 * found["load_n"].max(), "the load must have fallen"
    return found


@pytest.mark.parametrize("way", WAYS)
def test_the_curve_does_not_depend_on_it(
    way: str, broken: Problem, record: dict[str, np.ndarray], tmp_path: Path
) -> None:
    ranks, words, edit = WAYS[way]
    write_deck(tmp_path, broken)
    deck = (tmp_path / DECK).read_text()
    assert edit is str or edit(deck) != deck, "the deck must have changed"
    (tmp_path / DECK).write_text(edit(deck))
    run_deck(tmp_path, *words, ranks=ranks)
    other = read_curve(tmp_path / "curve.txt")
    assert other["step"].size == record["step"].size
    for name in ("load_n", "cmod_m", "stored_j", "dissipated_j"):
        assert other[name] == pytest.approx(record[name], abs=SAME * np.abs(record[name]).max()), name


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_restart_in_the_middle_of_softening(
    ranks: int, broken: Problem, record: dict[str, np.ndarray], tmp_path: Path
) -> None:
    middle = 300
    write_deck(tmp_path, broken, middle)
    deck = (tmp_path / DECK).read_text()
    (tmp_path / DECK).write_text(deck.replace("${steps_max} upto", f"{middle + 40} upto"))
    run_deck(tmp_path)
    assert read_curve(tmp_path / "curve.txt")["dissipated_j"][-1] > 0, "bonds must have softened by then"
    (tmp_path / DECK).write_text(deck)
    run_deck(tmp_path, "-var", "begin", str(middle), ranks=ranks)
    whole = read_curve(tmp_path / "curve.txt")
    for name in ("load_n", "cmod_m", "stored_j", "dissipated_j"):
        apart = np.abs(whole[name] - record[name]).max()
        # on one rank the same operations in the same order: the same bits
        assert apart <= (0.0 if ranks == 1 else SAME * np.abs(record[name]).max()), name
