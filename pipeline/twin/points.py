"""Irregular points in a specimen: nodes along its boundary, Poisson-disk points inside, evened out a little."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from pipeline.core.specimen import Specimen, crosses_notch

CLOSEST = 0.74  # smallest distance of Poisson-disk points over pitch that gives one point an area of √3/2 pitch²
SWEEPS = 3  # of smoothing; more makes patches of a regular lattice, none leaves slivers
BEYOND = 0.3  # pitches by which the joining node lies beyond the tip: so the compliance is that of the sharp notch
OFFSET = 1e-3  # distance of flank nodes from a notch of no width, in pitches
CORNER = np.pi / 6  # a turn of the outline sharper than this gets a node


def boundary_points(specimen: Specimen, pitch: float) -> np.ndarray:
    """Nodes (n, 2), m, about one pitch apart along outline, holes and both flanks of the notch."""
    *outlines, notch = specimen.outline()
    kept = _cut(specimen, pitch) if specimen.notch_width == 0 else np.empty((0, 2))
    lines = outlines if specimen.notch_width == 0 else [notch, *outlines]
    for line in lines:
        nodes, inside = _nudged(specimen, _along(line, pitch), OFFSET * pitch)
        nodes = nodes[inside]
        if len(kept):
            nodes = nodes[cKDTree(kept).query(nodes)[0] > 0.5 * pitch]
        kept = np.vstack([kept, nodes])
    return kept


def _cut(specimen: Specimen, pitch: float) -> np.ndarray:
    """Nodes of a notch without width: both flanks a hair's breadth apart, and one that joins them at the tip."""
    length = specimen.tip[1] + BEYOND * pitch
    y = np.linspace(0, length, max(round(length / pitch), 1), endpoint=False)
    right = np.column_stack([np.full(y.size, OFFSET * pitch), y])
    return np.vstack([right, right * (-1, 1), [(0.0, length)]])


def _along(line: np.ndarray, pitch: float) -> np.ndarray:
    """Nodes at equal steps along a polygon, one at each of its corners."""
    step = np.diff(line, axis=0)
    line = line[np.append(True, np.hypot(*step.T) > 1e-12)]
    step = np.diff(line, axis=0)
    turn = np.angle(np.exp(1j * np.diff(np.arctan2(step[:, 1], step[:, 0]))))
    corner = np.concatenate([[0], 1 + np.flatnonzero(np.abs(turn) > CORNER), [len(line) - 1]])
    arc = np.append(0, np.cumsum(np.hypot(*step.T)))
    sides = zip(arc[corner[:-1]], arc[corner[1:]], strict=True)
    stops = [np.linspace(a, b, max(round((b - a) / pitch), 1), endpoint=False) for a, b in sides]
    at = np.concatenate(stops)
    if not np.allclose(line[0], line[-1], rtol=0, atol=1e-9):  # a closed line ends where it began
        at = np.append(at, arc[-1])
    return np.column_stack([np.interp(at, arc, line[:, k]) for k in (0, 1)])


def _nudged(specimen: Specimen, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Points pushed into the material by at most `reach`, and which of them lie in it then."""
    angle = np.arange(8) * np.pi / 4
    moves = np.vstack([[(0, 0)], reach * np.column_stack([np.cos(angle), np.sin(angle)])])
    inside = np.stack([specimen.contains(points + move) for move in moves])
    return points + moves[np.argmax(inside, axis=0)], np.any(inside, axis=0)


def poisson_disk(specimen: Specimen, pitch: float, fixed: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Random points (n, 2), m, that keep their distance from each other and from the fixed ones (dart throwing)."""
    low, high = np.reshape(specimen.bounds, (2, 2))
    throws = int(np.prod(high - low) / pitch**2)
    points = fixed
    for _ in range(60):  # by then the gaps left are too small for another point
        darts = rng.uniform(low, high, (throws, 2))
        darts = darts[specimen.contains(darts)]
        darts = darts[cKDTree(points).query(darts)[0] > CLOSEST * pitch]
        points = np.vstack([points, darts[_first_come(darts, CLOSEST * pitch)]])
    return points[len(fixed) :]


def _first_come(points: np.ndarray, distance: float) -> np.ndarray:
    """Which points stay when each drives away the later ones that are too near; (n,) bool."""
    stays = np.ones(len(points), bool)
    close = cKDTree(points).query_pairs(distance, output_type="ndarray") if len(points) else np.empty((0, 2), int)
    close = np.sort(close, axis=1)
    for first, second in close[np.lexsort(close.T[::-1])].tolist():
        if stays[first]:
            stays[second] = False
    return stays


def triangles(specimen: Specimen, points: np.ndarray, pitch: float) -> np.ndarray:
    """Delaunay triangles (t, 3) that lie in the material and do not cross the notch."""
    corners = Delaunay(points).simplices
    a, b, c = (points[corners[:, k]] for k in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    good = specimen.contains((a + b + c) / 3) & (area > 1e-3 * pitch**2)
    for start, end in ((a, b), (b, c), (c, a)):
        good &= ~crosses_notch(specimen, start, end)
    return corners[good]


def smoothed(specimen: Specimen, fixed: np.ndarray, inner: np.ndarray, pitch: float) -> np.ndarray:
    """Inner points moved to the centre of the triangles around them (n, 2), m; one sweep."""
    points = np.vstack([fixed, inner])
    corners = triangles(specimen, points, pitch)
    place = points[corners]
    one, two = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    area = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    moment = np.repeat(area[:, None] * place.mean(axis=1), 3, axis=0)
    owner = corners.ravel()
    weight = np.bincount(owner, np.repeat(area, 3), len(points))
    centre = np.column_stack([np.bincount(owner, moment[:, k], len(points)) for k in (0, 1)])
    used = weight > 0
    moved = points.copy()
    moved[used] = centre[used] / weight[used, None]
    result = moved[len(fixed) :]
    return result[specimen.contains(result)]


def irregular_points(specimen: Specimen, pitch: float, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """Points (n, 2), m, of an irregular network, and how many of them, the first, lie on the boundary.

    Parameters
    ----------
    specimen : Specimen
    pitch : float, m; spacing of the hexagonal lattice with as many points per area
    rng : numpy Generator
    """
    fixed = boundary_points(specimen, pitch)
    inner = poisson_disk(specimen, pitch, fixed, rng)
    for _ in range(SWEEPS):
        inner = smoothed(specimen, fixed, inner, pitch)
    return np.vstack([fixed, inner]), len(fixed)
