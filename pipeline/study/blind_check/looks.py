"""What tests of one specimen share: the strip around the crack and the CMOD values at which simulations are kept.

Found from the sealed bundles alone, before any is diagnosed, so that it does not matter which is diagnosed first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.units import MM
from pipeline.store.atomic import write_atomically
from pipeline.store.results import prepare_output
from pipeline.study.blind_check.seal import canonical, read_json

LOOKS, STRIPS = "looks", "strips.json"
NEAR = 2 * MM  # paths so near are one: the strip is 3 mm wide either side; rasters of points show paths to 0.8 mm
ALIKE = 1.4  # peaks whose CMOD differs by no more have their simulations kept at the same values


@dataclass(frozen=True, eq=False)
class Look:
    """One bundle before it is diagnosed.

    Parameters
    ----------
    name : str
    model : str; key of the model, the same for tests of one specimen
    path : (k, 2) array, m, of the crack, or None: the fields do not show it
    peak, last : float, m; CMOD at the measured peak and at the last station
    """

    name: str
    model: str
    path: np.ndarray | None
    peak: float
    last: float


def write_look(out: Path, look: Look) -> None:
    """Keep a look in OUT/looks."""
    path = None if look.path is None else look.path.tolist()
    row = {"model": look.model, "path_m": path, "peak_m": look.peak, "last_m": look.last}
    write_atomically(prepare_output(out / LOOKS) / f"{look.name}.json", canonical(row))


def read_looks(out: Path, names: Sequence[str]) -> list[Look]:
    """The looks that are there."""
    found = []
    for name in names:
        file = out / LOOKS / f"{name}.json"
        if file.exists():
            row = read_json(file)
            path = None if row["path_m"] is None else np.array(row["path_m"])
            found.append(Look(name, row["model"], path, row["peak_m"], row["last_m"]))
    return found


def strips(looks: Sequence[Look]) -> dict[str, dict[str, Any]]:
    """What every bundle shares with others: "path_m", of the test whose path most others lie near to, None where its
    fields show none; "peak_m" and "last_m"."""
    found: dict[str, dict[str, Any]] = {}
    for model in sorted({look.model for look in looks}):
        same = sorted((look for look in looks if look.model == model), key=lambda look: look.name)
        last = max(look.last for look in same)
        for leader, members in led(same, lambda a, b: max(a.peak / b.peak, b.peak / a.peak) <= ALIKE):
            found |= {m.name: {"path_m": None, "peak_m": leader.peak, "last_m": last} for m in members}
        for leader, members in led([look for look in same if look.path is not None], _near):
            assert leader.path is not None
            for member in members:
                found[member.name]["path_m"] = leader.path.tolist()
    return found


def led(looks: Sequence[Look], alike: Callable[[Look, Look], bool]) -> list[tuple[Look, list[Look]]]:
    """Groups, each led by the look that most of those left are alike."""
    left, found = list(looks), []
    while left:
        leader = max(left, key=lambda one: sum(alike(one, other) for other in left))  # the first of equals
        members = [other for other in left if alike(leader, other)]
        found.append((leader, members))
        left = [other for other in left if other not in members]
    return found


def _near(one: Look, two: Look) -> bool:
    assert one.path is not None
    assert two.path is not None
    return apart(one.path, two.path) < NEAR


def apart(one: np.ndarray, two: np.ndarray) -> float:
    """The farthest (m) that two paths (k, 2) lie apart at heights that both have."""
    low, high = max(one[0, 1], two[0, 1]), min(one[-1, 1], two[-1, 1])
    height = np.linspace(low, high, 40)
    across = [np.interp(height, *path[np.argsort(path[:, 1], kind="stable")][:, ::-1].T) for path in (one, two)]
    return float(np.abs(across[0] - across[1]).max())


def write_strips(out: Path, names: Sequence[str]) -> Mapping[str, Any]:
    """Write what the bundles share into OUT/strips.json."""
    found = strips(read_looks(out, names))
    write_atomically(out / STRIPS, canonical(found))
    return found
