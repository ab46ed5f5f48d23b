"""A few coordinates for differences of displacement fields: what two honest models differ by, and what tests show."""

from __future__ import annotations

import numpy as np

from pipeline.gap.observation import Sight

RIGID = ("shift along x", "shift along y", "rotation")
STRAIN = ("strain along x", "strain along y", "shear strain")
CRACK = ("opening", "crack rotation", "sliding")
MODES = (*RIGID, *STRAIN, *CRACK)
REMAINDER, LOAD = "remainder", "load"
GROUPS = {m: g for g, ms in (("rigid", RIGID), ("strain", STRAIN)) for m in ms} | {m: m for m in CRACK}
EVEN = ("shift along y", "strain along x", "strain along y", "opening", "crack rotation", LOAD)  # mirrored: the same
MIRRORED = np.array([1.0 if m in EVEN else -1.0 for m in (*MODES, LOAD)])  # what the mirror image of a specimen has
ROUNDS, FAIR = 10, 2.0  # of weighting anew; medians up to which a point counts in full
ARM = 10e-3  # m; rotations and strains are counted by the displacement they give at this distance from the tip


def shapes(sight: Sight) -> np.ndarray:
    """Displacements (p, 2, k) of the points for one metre of every mode of `MODES`.

    Rotations and strains act about the notch tip and have one metre at `ARM` from it, so that their amplitudes do not
    depend on which points are looked at. Opening and sliding move the flanks by half a metre either way, the rotation
    of the crack turns them against each other about the tip.
    """
    x, y = ((sight.points - sight.tip) / ARM).T
    one, none, half = np.ones_like(x), np.zeros_like(x), 0.5 * sight.side
    columns = (
        (one, none),
        (none, one),
        (-y, x),
        (x, none),
        (none, y),
        (y / 2, x / 2),
        (half, none),
        (-half * y, half * x),
        (none, half),
    )
    return np.stack([np.column_stack(c) for c in columns], axis=-1)


def amplitudes(sight: Sight, weight: np.ndarray) -> np.ndarray:
    """Operators (s, k, 2p) that take a field (2p,), m, to the amplitudes (k,), m, of its modes at every station.

    Least squares over the points that are there, of smallest norm where they cannot tell two modes apart.

    Parameters
    ----------
    sight : Sight
    weight : (s, p) array; 1 where a point counts, 0 where it does not
    """
    basis = shapes(sight).reshape(-1, len(MODES))
    found = np.zeros((len(weight), len(MODES), len(basis)))
    for station, use in enumerate(np.repeat(weight > 0, 2, axis=1)):
        if use.sum() >= 4:
            found[station][:, use] = np.linalg.pinv(basis[use], rcond=1e-6)
    return found


def modal(sight: Sight, use: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """What fields (k, p, 2) have of the modes, at all points.

    By least squares in which points that differ by many times the usual count less (Huber 1964): a fragment that comes
    off beside the crack says nothing of the flanks.

    Parameters
    ----------
    sight : Sight
    use : (k, p) bool; points that count
    fields : (k, p, 2) array, m; anything where a point does not count
    """
    basis = shapes(sight)
    found = np.zeros(fields.shape)
    for k, (some, field) in enumerate(zip(use, fields, strict=True)):
        if 2 * some.sum() <= len(MODES):
            continue
        part, target = basis[some], field[some]
        weight = np.ones(len(part))
        for _ in range(ROUNDS):
            root = np.sqrt(weight)[:, None]
            amplitude = (
                np.linalg.pinv((root[..., None] * part).reshape(-1, len(MODES)), rcond=1e-6) @ (root * target).ravel()
            )
            left = np.hypot(*(target - part @ amplitude).T)
            usual = FAIR * float(np.median(left))
            weight = np.minimum(1.0, usual / np.maximum(left, 1e-300)) if usual > 0 else weight
        found[k] = basis @ amplitude
    return found
