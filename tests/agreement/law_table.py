"""The table of laws and paths that drives both languages: name, law, path of (opening, sliding, duration)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pipeline.materials.burgers import Burgers
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.relaxation import Arms, arms
from pipeline.materials.softening import LINEAR, Shape, Softening, Unloading

KN, FN, DN = 3.7e8, 71.0, 1.14e-4
KS, FT, DT = 1.2e8, 50.0, 2.0e-4
PEAK = FN / KN
SHAPES = {
    "linear": LINEAR,
    "exponential": Softening(Shape.EXPONENTIAL),
    "bilinear-tail": Softening(Shape.BILINEAR_TAIL),
    "short tail": Softening(Shape.BILINEAR_TAIL, 0.35),
}
# load, unload, reload, go on, compress, fail, compress after failure, open again; in delta_max
OPENINGS = [0.001, 0.0017, 0.3, 0.1, 0.3, 0.5, -0.2, 0.2, 0.45, 0.7, 1.5, 5.0, 0.4, -0.1, 0.05, 0.0]
BURGERS = Burgers(d1=1.2e-10, d2=0.7e-10, eta1=8e11, tau2=12.0).relaxation()


def at_angle(degrees: float) -> np.ndarray:
    """The openings along one direction of opening and sliding."""
    size = np.array(OPENINGS) * DT
    return np.column_stack([size * np.cos(np.radians(degrees)), size * np.sin(np.radians(degrees)), 0 * size])


def turning() -> np.ndarray:
    """Directions that change: open, slide while open, close and slide back, open until failure, rub."""
    corners = np.array([(0, 0), (0.2, 0.05), (0.25, 0.7), (-0.1, 0.4), (-0.1, -0.9), (0.5, 0.2), (6, 2), (-0.2, 1)])
    legs = [a + np.linspace(0, 1, 9)[1:, None] * (b - a) for a, b in pairwise(corners)]
    path = np.concatenate([*legs, [(-0.2, -1), (-0.3, -1.2), (0.1, 0)]]) * DN
    return np.column_stack([path, np.zeros(len(path))])


def mixed(shape: Softening, unloading: Unloading, friction: float = 0.0) -> MixedSoftening:
    """One bond that opens and slides."""
    return MixedSoftening(KN, KS, FN, FT, DN, DT, shape, unloading, friction)


def creeping(
    shape: Softening = LINEAR, unloading: Unloading = Unloading.SECANT, left: float = 0.0
) -> CreepingSoftening:
    """One bond of a Burgers material, with a share that never relaxes."""
    rise = arms(BURGERS, np.array([KN / BURGERS.instantaneous]))
    kept = Arms(rise.stiffness * (1 - left), rise.time, left * rise.instantaneous)
    return CreepingSoftening(kept, np.array([FN]), np.array([DN]), shape, unloading)


def slowly(*legs: tuple[float, float, int]) -> np.ndarray:
    """Legs (opening in delta_peak, duration in s, steps), with steps that grow from a tenth to twice the mean."""
    path, before = [], 0.0
    for opening, duration, steps in legs:
        grown = np.cumsum(np.linspace(0.1, 1.9, steps))
        grown, waits = grown / grown[-1], np.diff(grown, prepend=0) / grown[-1] * duration
        path += [(before + s * (opening - before), 0.0, d) for s, d in zip(grown, waits, strict=True)]
        before = opening
    return np.array(path) * [PEAK, 1, 1]


PULLED = np.column_stack([np.array(OPENINGS) * DN, np.zeros((len(OPENINGS), 2))])
RELAX = slowly((0.6, 0.0, 1), (0.6, 50.0, 20), (0.6, 900.0, 10))
CREEP = slowly((0.5, 2.0, 10), (1.4, 40.0, 30), (-0.5, 10.0, 10), (1.5, 30.0, 20), (4.0, 20.0, 20))
FAIL = slowly((3.0, 60.0, 40), (300.0, 5.0, 20), (100.0, 5.0, 4), (-2.0, 1.0, 2), (400.0, 50.0, 5), (3000.0, 1.0, 5))
SHRUNK = slowly((-3.0, 300.0, 20), (2.0, 0.5, 10), (0.2, 0.5, 2), (60.0, 1.0, 6), (-4.0, 1.0, 4), (3000.0, 5.0, 5))

TABLE = {
    "linear": (LinearSoftening(KN, FN, DN), PULLED),
    "no damage": (LinearSoftening(KN, np.inf, np.inf), PULLED),
    **{f"{n}, {u}": (CentralSoftening(KN, FN, DN, s, u), PULLED) for n, s in SHAPES.items() for u in Unloading},
    **{
        f"{n}, {u}, {degrees} degrees": (mixed(s, u), at_angle(degrees))
        for n, s in SHAPES.items()
        for u in Unloading
        for degrees in (0, 25, 45, 80, 90, 130, 180)
    },
    **{f"{n}, {u}, turning": (mixed(s, u), turning()) for n, s in SHAPES.items() for u in Unloading},
    **{f"{n}, {u}, rubbing": (mixed(s, u, 0.6), turning()) for n, s in SHAPES.items() for u in Unloading},
    "sliding without damage": (MixedSoftening(KN, KS, np.inf, np.inf, np.inf, np.inf), turning()),
    "relaxation": (creeping(), RELAX),
    "relaxation to a rest": (creeping(left=0.3), RELAX),
    **{f"creep, {n}, {u}": (creeping(s, u), CREEP) for n, s in SHAPES.items() for u in Unloading},
    **{f"creep and failure, {n}, {u}": (creeping(s, u, 0.2), FAIL) for n, s in SHAPES.items() for u in Unloading},
    **{f"creep under compression, {n}, {u}": (creeping(s, u), SHRUNK) for n, s in SHAPES.items() for u in Unloading},
}
