"""The words of fix cohesive/drive: what is wrong with them is said, with the value and the rule."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from .bonds import chain

GOOD = {
    "gauge": "gauge w",
    "grip": "grip w 1 0 1 drive",
    "cmod": "cmod 1e-4",
    "omega": "omega 0.01",
    "lag": "lag 0.01",
    "load": "load 10",
    "rate": "rate 1e-9 1e-10 1e-8",
}


@pytest.fixture(scope="module")
def lmp() -> Iterator[Any]:
    with chain("3.7e8 71.0 1.14e-4") as lammps:
        lammps.command("fix w all property/atom rmass d_w")
        yield lammps


def words(**other: str) -> str:
    return "fix drive all cohesive/drive " + " ".join((GOOD | other).values())


def test_good_words_are_taken(lmp: Any) -> None:
    lmp.command(words(more="record 10 frames 2 1e-5 2e-5 clock 2 0 0 1e-4 12"))
    assert lmp.has_id("fix", "drive")
    lmp.command("unfix drive")
    assert not lmp.has_id("fix", "drive")


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ({"grip": "grip w 1 1 1 drive"}, r"direction = \(1, 1\) of a grip must be a unit vector"),
        ({"grip": "grip w 1 0 1 push"}, "role = push of a grip must be drive, react or guide"),
        ({"grip": ""}, "needs grips and a gauge"),
        ({"gauge": ""}, "needs grips and a gauge"),
        ({"cmod": "cmod 0"}, "cmod = 0 m must be positive"),
        ({"omega": "omega -1"}, "omega = -1 must be positive"),
        ({"lag": "lag 0"}, "lag = 0 must be positive"),
        ({"load": "load 0"}, "load = 0 N must be positive"),
        ({"rate": "rate 1 2 3"}, "rates 1 2 3 must be positive, and the first between lowest and highest"),
        ({"more": "record 0"}, "record = 0 must be positive"),
        ({"more": "frames -2"}, "number of frames = -2 must be zero or positive"),
        ({"more": "frames 3 1e-5"}, r"'frames' needs 4 more value\(s\)"),
        ({"more": "clock -2"}, "number of clock = -2 must be zero or positive"),
        ({"more": "clock 2 0 0 1e-4 0"}, "must be two or more values that increase from 0"),
        ({"more": "speed 3"}, "does not know 'speed'"),
    ],
)
def test_others_are_refused(lmp: Any, other: dict[str, str], told: str) -> None:
    with pytest.raises(Exception, match=told):
        lmp.command(words(**other))


def test_it_moves_all_particles_or_none(lmp: Any) -> None:
    lmp.command("group some id 1")
    with pytest.raises(Exception, match="fix cohesive/drive moves all particles: its group must be all, not some"):
        lmp.command(words().replace("drive all", "drive some"))
