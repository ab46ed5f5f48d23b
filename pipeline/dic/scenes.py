"""Cracks drawn at random, to judge the correlation with: curved, branching, any angle, opening and sliding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.dic.motion import Affine, Cracked, Cut
from pipeline.dic.speckle import Pair, photograph_pair

_BEND = 4e-4  # 1/px; greatest curvature of the drawn fields: 25 px affine subsets err by less than 0.01 px


@dataclass(frozen=True)
class Scene:
    """A pair of pictures with cracks.

    Parameters
    ----------
    pair : Pair
    opening : float, px; greatest opening that the main crack may reach
    kind : "straight", "curved" or "branched"
    """

    pair: Pair
    opening: float
    kind: str


def random_scene(seed: int, size: int = 500) -> Scene:
    """A picture of size × size px with a crack; openings from 0.2 to 40 px, even in the logarithm."""
    random = np.random.default_rng(seed)
    kind = ("straight", "curved", "branched")[random.integers(3)]
    opening = float(np.exp(random.uniform(np.log(0.2), np.log(40))))
    sliding = opening * random.uniform(-0.5, 0.5) if random.random() < 0.5 else 0.0
    angle = random.uniform(0, 2 * np.pi)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    length = _ramp_length(float(np.hypot(opening, sliding)))
    ahead = random.uniform(-0.3 * size, max(length - 0.3 * size, 0.3 * size))
    tip = np.full(2, size / 2) + across * random.uniform(-0.25, 0.25) * size - along * ahead
    course = _straight if kind == "straight" else _wave(random)
    cuts = [Cut((tip[0], tip[1]), angle, (opening, sliding), _ramp(length), course)]
    if kind == "branched":
        fork = float((np.full(2, size / 2) - tip) @ along) + random.uniform(-0.2, 0.2) * size
        cuts.append(_branch(cuts[0], fork, random))
    shift, g = random.uniform(-3, 3, 2), random.uniform(-2e-3, 2e-3, (2, 2))
    smooth = Affine((shift[0], shift[1]), ((g[0, 0], g[0, 1]), (g[1, 0], g[1, 1])), (size / 2, size / 2))
    return Scene(photograph_pair(Cracked(tuple(cuts), smooth), (size, size), seed + 1000), opening, kind)


def two_cracks(distance: float, opening: float, size: int = 300, seed: int = 1) -> Pair:
    """Two parallel cracks so far apart (px), each as wide open, along the columns of the picture's middle."""
    cuts = [
        Cut((size / 2 + shift - 0.25, -2.0 * size), np.pi / 2, (opening, 0.0), np.ones_like)
        for shift in (-distance / 2, distance / 2)
    ]
    return photograph_pair(Cracked(tuple(cuts)), (size, size), seed)


def _branch(main: Cut, fork: float, random: np.random.Generator) -> Cut:
    """A second arm that leaves the main crack at ξ = fork towards a tip of its own."""
    slope, opening = random.uniform(0.3, 1.2), main.jump[0] * random.uniform(0.3, 1)
    tip = fork - random.uniform(60, 200)
    start = np.asarray(main.tip) + tip * np.array([np.cos(main.angle), np.sin(main.angle)])

    def course(xi: np.ndarray) -> np.ndarray:
        before = np.maximum(fork - tip - xi, 0)
        return main.course(xi + tip) + slope * (np.sqrt(before**2 + 25) - 5)

    return Cut((start[0], start[1]), main.angle, (opening, 0.0), _ramp(_ramp_length(opening)), course)


def _ramp_length(jump: float) -> float:
    return float(max(np.sqrt(5.8 * jump / _BEND), 60.0))  # 5.8: greatest second derivative of the ramp


def _ramp(length: float):  # type: ignore[no-untyped-def]  # a profile of Cut
    def profile(xi: np.ndarray) -> np.ndarray:
        t = np.clip(xi / length, 0, 1)
        return t**3 * (10 - 15 * t + 6 * t**2)

    return profile


def _straight(xi: np.ndarray) -> np.ndarray:
    return np.zeros_like(xi)


def _wave(random: np.random.Generator):  # type: ignore[no-untyped-def]  # a course of Cut
    height, length, phase = random.uniform(2, 20), random.uniform(150, 500), random.uniform(0, 2 * np.pi)

    def course(xi: np.ndarray) -> np.ndarray:
        return height * (np.sin(2 * np.pi * xi / length + phase) - np.sin(phase))

    return course
