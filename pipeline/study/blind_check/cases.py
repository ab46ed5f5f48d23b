"""Which cases a blind check holds: effects × multiples of their detection limits × specimens × noise, and controls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.gap.effects import effect, library

MULTIPLES = (0.5, 1.0, 2.0, 4.0)
NOISE = {"low": (0.005, 5.0), "high": (0.02, 15.0)}  # of displacement (px of 0.0439 mm) and load (N)
REPLICATES = 4  # specimens of a set that is diagnosed together
STRANGERS = {"aggregate_modulus": -0.5, "gauge_length": 0.5}  # no library has them; relative change
HIDDEN = 5.0  # detection limits of an effect that the library lacks
SHORTENED = 0.2  # of the tests with an effect are judged by a library that lacks others
LACKING = 3  # effects that are left out wherever something is, the hidden one among them or not


@dataclass(frozen=True)
class Case:
    """One sealed test.

    Parameters
    ----------
    name : str; says nothing
    specimen : int; number of the specimen, replicates share it
    geometry : str
    effects : name → value; of the library
    stranger : (name, value) or None; an effect that no library has
    kind : "none", "effect", "pair" or "outside"
    multiple : float; of the detection limit assumed, after the cap
    noise : key of `NOISE`
    images : bool; speckle images instead of fields
    without : effects that the library of this diagnosis must do without
    replicates : name of the set that is also diagnosed together; "" where alone
    """

    name: str
    specimen: int
    geometry: str
    effects: Mapping[str, float]
    kind: str
    multiple: float = 0.0
    noise: str = "low"
    images: bool = False
    without: tuple[str, ...] = ()
    stranger: tuple[str, float] | None = None
    replicates: str = ""


@dataclass(frozen=True)
class Size:
    """How large a check is.

    Parameters
    ----------
    radius_mm : float; of the diagnosing lattice
    edge_mm : float; of the triangles
    specimens : geometry of each specimen
    frames : int; fields under load, so close that nothing is lost between two of them at the peak
    pictures : int; the same where they are speckle images, which cost more
    camera_mm_per_px : float; of speckle images
    step_px : int; of the grid of their correlation
    cmod_max_mm : float
    """

    radius_mm: float
    edge_mm: float
    specimens: tuple[str, ...]
    frames: int
    pictures: int
    camera_mm_per_px: float
    step_px: int
    cmod_max_mm: Mapping[str, float] = field(default_factory=lambda: {"seb": 0.55, "dct": 0.6})


SIZES = {
    "small": Size(1.5, 2.0, ("seb",) * 2, 121, 41, 0.09, 12),
    "full": Size(1.0, 1.5, ("seb",) * 6, 121, 41, 0.0439, 24),  # geometry and radius of the library that ships
}
# small: what each of the twelve cases is, in the order of the library's kinds
SMALL = (
    (), (), (("load_gain", 4.0),), (("drift_um_per_min", 4.0),), (("magnification", 4.0),), (("cmod_gain", 2.0),),
    (("modulus", 4.0),), (("notch_length_mm", 4.0),), (("tip_damage", 2.0),), (("lens_distortion", 4.0),),
    (("load_gain", 4.0), ("modulus", 4.0)),
)  # fmt: skip


def sized(name: str, multiple: float, limits: Mapping[str, float], sign: float) -> tuple[float, float]:
    """Value of an effect at a multiple of its limit, capped at the plausible maximum, and the multiple it then is."""
    range_ = effect(name).magnitude
    downwards = sign < 0 and range_.low < 0
    most = -range_.low if downwards else range_.high
    value = float(f"{min(multiple * limits[name], most):.3g}")  # as a person would put it
    return (-value if downwards else value), value / limits[name]


def drawn_cases(size: str, limits: Mapping[str, float], rng: np.random.Generator) -> list[Case]:
    """The cases of a check, in random order under names that say nothing."""
    chosen = SIZES[size]
    rows = _small(limits, rng) if size == "small" else _full(limits, rng)
    rows = [rows[k] for k in rng.permutation(len(rows)).tolist()]
    filmed = set(rng.choice(len(rows), -(-len(rows) // 5), replace=False).tolist())
    cases = []
    for number, row in enumerate(rows):
        specimen = row.pop("specimen", None)
        specimen = int(rng.integers(len(chosen.specimens))) if specimen is None else specimen
        cases.append(
            Case(
                name=f"case-{number:04d}",
                specimen=specimen,
                geometry=chosen.specimens[specimen],
                images=number in filmed,
                **row,
            )
        )
    return cases


def _replicates(limits: Mapping[str, float], rng: np.random.Generator) -> list[dict[str, Any]]:
    """Sets of tests with the same effect at the largest multiple and low noise, or without any; every effect also at
    high noise on one of the specimens, and once more, larger, where the library lacks it."""
    sets, alone = _free(limits, rng), []
    for name in library():
        sign = _sign(rng)
        row = _row(((name, max(MULTIPLES)),), limits, sign) | {"noise": "low"}
        one = _shortened(row, rng)
        sets.append([one | {"specimen": k} for k in range(REPLICATES)])
        again = {"specimen": int(rng.integers(REPLICATES))}
        alone.append(row | again | {"noise": "high"})
        alone.append(_left_out(_row(((name, HIDDEN),), limits, sign) | again, True, rng))
    labels = [f"set-{k:02d}" for k in rng.permutation(len(sets)).tolist()]
    return alone + [row | {"replicates": label} for label, rows in zip(labels, sets, strict=True) for row in rows]


def _free(limits: Mapping[str, float], rng: np.random.Generator) -> list[list[dict[str, Any]]]:
    """Sets of effect-free tests, on every specimen at both noises, with the whole library and with a shortened one."""
    places = [[(k, noise) for k in range(REPLICATES)] for noise in NOISE]
    others = range(REPLICATES, len(SIZES["full"].specimens))
    places.append([(k, noise) for noise in NOISE for k in others])
    none = _row((), limits, 1.0)
    rows = [row for _ in places for row in (none, _left_out(none, False, rng))]
    return [
        [row | {"specimen": k, "noise": noise} for k, noise in where]
        for row, where in zip(rows, [w for w in places for _ in range(2)], strict=True)
    ]


def _row(names: tuple[tuple[str, float], ...], limits: Mapping[str, float], sign: float) -> dict[str, Any]:
    sizes = {n: sized(n, m, limits, sign) for n, m in names}
    kind = ("none", "effect", "pair")[len(names)]
    reached = min((m for _, m in sizes.values()), default=0.0)
    return {"effects": {n: v for n, (v, _) in sizes.items()}, "kind": kind, "multiple": reached}


def _left_out(row: dict[str, Any], hidden: bool, rng: np.random.Generator) -> dict[str, Any]:
    """The row with a library that lacks some effects: its own, or only others."""
    others = [n for n in library() if n not in row["effects"]]
    own = list(row["effects"]) if hidden else []
    names = [*rng.choice(others, LACKING - len(own), replace=False).tolist(), *own]
    return row | {"without": tuple(sorted(names)), "kind": "outside" if hidden else row["kind"]}


def _shortened(row: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """The row, now and then with a library that lacks others: effect-free tests with such are not alone then."""
    return _left_out(row, False, rng) if rng.uniform() < SHORTENED else row


def _small(limits: Mapping[str, float], rng: np.random.Generator) -> list[dict[str, Any]]:
    rows = [_row(names, limits, _sign(rng)) for names in SMALL]
    rows.append(_left_out(_row((("load_gain", 4.0),), limits, _sign(rng)), True, rng))
    rows[2] = _left_out(rows[2], False, rng)
    return rows


def _full(limits: Mapping[str, float], rng: np.random.Generator) -> list[dict[str, Any]]:
    geometries = SIZES["full"].specimens
    rows = _replicates(limits, rng)
    for name in library():
        rows += _smaller(name, limits, len(geometries), rng)
    for specimen in range(len(geometries)):
        for name, value in STRANGERS.items():
            rows.append(_row((), limits, 1.0) | {"kind": "outside", "stranger": (name, value), "specimen": specimen})
    return rows + [_pair(limits, rng) for _ in range(2 * len(geometries))]


def _smaller(name: str, limits: Mapping[str, float], specimens: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """An effect at the smaller multiples, each on one specimen at both noises; sizes that the cap makes alike once."""
    rows: list[dict[str, Any]] = []
    known = {sized(name, max(MULTIPLES), limits, sign)[0] for sign in (-1.0, 1.0)}  # of the replicates
    for multiple in sorted(MULTIPLES)[:-1]:
        row = _row(((name, multiple),), limits, _sign(rng)) | {"specimen": int(rng.integers(specimens))}
        if row["effects"][name] in known:
            continue
        for noise in NOISE:
            rows.append(_shortened(row | {"noise": noise}, rng))
    return rows


def _pair(limits: Mapping[str, float], rng: np.random.Generator) -> dict[str, Any]:
    """Two effects, each of which could be detected."""
    names = [n for n in library() if limits[n] <= effect(n).magnitude.high]
    return _row(tuple((str(n), 4.0) for n in rng.choice(names, 2, replace=False)), limits, _sign(rng))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))
