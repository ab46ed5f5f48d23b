"""Unstructured triangles over a specimen: fine and irregular around the ligament, coarse far from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from pipeline.core.errors import ConvergenceError
from pipeline.core.specimen import Specimen

COARSEST, GROWTH = 2.0, 0.25  # largest edge over the finest; growth of the edge per distance from the zone
SMOOTHING = 25  # turns in which points move between their neighbours
NEAREST = 0.55  # of the local edge: no point lies nearer to the boundary
SHARP = 0.9  # cosine of the turn from which a corner is kept
FLATTEST = 0.02  # area over squared longest side: flatter triangles, at straight boundaries, are no material


@dataclass(frozen=True)
class Zone:
    """The rectangle in which edges can part; m."""

    half_width: float
    low: float
    high: float

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) in m of points (n, 2) from the zone; 0 inside."""
        aside = np.maximum(np.abs(points[:, 0]) - self.half_width, 0.0)
        along = np.maximum(np.maximum(self.low - points[:, 1], points[:, 1] - self.high), 0.0)
        return np.hypot(aside, along)

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 2) lie in it."""
        return self.distance(points) == 0


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles over points.

    Parameters
    ----------
    points : (p, 2) array, m
    corners : (t, 3) int array, counter-clockwise
    """

    points: np.ndarray
    corners: np.ndarray

    @cached_property
    def area(self) -> np.ndarray:
        """(t,) array, m²"""
        return areas(self.points, self.corners)

    @cached_property
    def centre(self) -> np.ndarray:
        """(t, 2) array, m"""
        return self.points[self.corners].mean(axis=1)

    @cached_property
    def inner_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (e, 2) at the ends of the edges between two triangles, and these triangles (e, 2)."""
        t = len(self.corners)
        ends = np.sort(np.vstack([self.corners[:, [0, 1]], self.corners[:, [1, 2]], self.corners[:, [2, 0]]]), axis=1)
        owner = np.tile(np.arange(t), 3)
        order = np.lexsort((owner, ends[:, 1], ends[:, 0]))
        ends, owner = ends[order], owner[order]
        twin = np.flatnonzero(np.all(ends[1:] == ends[:-1], axis=1))
        return ends[twin], np.column_stack([owner[twin], owner[twin + 1]])

    def without(self, gone: np.ndarray) -> Mesh:
        """The mesh without some triangles (t,) bool."""
        return Mesh(self.points, self.corners[~gone])

    def triangle_at(self, places: np.ndarray) -> np.ndarray:
        """Triangle that holds each place (n, 2), m; −1 where none does."""
        found: np.ndarray = self._finder(places)
        return found

    @cached_property
    def _finder(self) -> TriangleFinder:
        return TriangleFinder(self)


class TriangleFinder:
    """Which triangle holds a place: the nearest centres are tried first."""

    def __init__(self, mesh: Mesh, tried: int = 12):
        self.tree, self.mesh, self.tried = cKDTree(mesh.centre), mesh, min(tried, len(mesh.corners))

    def __call__(self, places: np.ndarray) -> np.ndarray:
        near = self.tree.query(places, self.tried)[1].reshape(len(places), self.tried)
        corner = self.mesh.points[self.mesh.corners[near]]
        holds = np.all(shares(corner, places[:, None, :]) >= -1e-9, axis=2)
        return np.where(holds.any(axis=1), near[np.arange(len(places)), np.argmax(holds, axis=1)], -1)


def areas(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Signed areas (t,) of triangles."""
    a, b, c = (points[corners[:, k]] for k in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def shares(corner: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (…, 3) of places (…, 2) in triangles (…, 3, 2)."""
    one, two = corner[..., 1, :] - corner[..., 0, :], corner[..., 2, :] - corner[..., 0, :]
    rest = place - corner[..., 0, :]
    whole = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
    second = (rest[..., 0] * two[..., 1] - rest[..., 1] * two[..., 0]) / whole
    third = (one[..., 0] * rest[..., 1] - one[..., 1] * rest[..., 0]) / whole
    return np.stack([1 - second - third, second, third], axis=-1)


def edge_size(points: np.ndarray, zone: Zone, edge: float) -> np.ndarray:
    """Wanted edge length (n,) in m at points (n, 2)."""
    return np.minimum(edge + GROWTH * zone.distance(points), COARSEST * edge)


def triangulate(
    specimen: Specimen, zone: Zone, edge: float, rng: np.random.Generator, straight: bool = False
) -> tuple[Mesh, np.ndarray]:
    """Irregular triangles over a specimen.

    Parameters
    ----------
    specimen : Specimen; a notch of zero width becomes a row of edges on its line
    zone : Zone; edges have the wanted length there
    edge : float, m
    rng : numpy Generator
    straight : bool; the line of a notch of zero width goes on through the specimen as a row of edges

    Returns
    -------
    mesh : Mesh
    slit : (k,) int array; points on a notch of zero width, from the mouth to the tip, or on to the other side
    """
    wall, slit_count = _wall(specimen, zone, edge, straight)
    inside = _scatter(specimen, zone, edge, wall, rng)
    points = np.vstack([wall, inside])
    fixed = len(wall)
    for _ in range(SMOOTHING):
        points = _smoothed(points, fixed, _triangles(points, specimen), zone, edge)
        keep = np.ones(len(points), bool)
        keep[fixed:] = _clear(points[fixed:], specimen, zone, edge, wall)
        points = points[keep]
    corners = _triangles(points, specimen)
    used = np.unique(corners)
    number = np.full(len(points), -1)
    number[used] = np.arange(used.size)
    mesh = Mesh(points[used], number[corners])
    slit = number[:slit_count]
    _check_slit(mesh, slit)
    return mesh, slit


def _wall(specimen: Specimen, zone: Zone, edge: float, straight: bool) -> tuple[np.ndarray, int]:
    """Points on the boundary, those of a notch of zero width first and from mouth to tip; how many these are."""
    *bodies, notch = specimen.outline()
    tip = np.asarray(specimen.tip)
    slit = np.zeros((0, 2))
    if specimen.notch_width == 0:
        slit = _walk(np.array([(0.0, 0.0), tip]), zone, edge, closed=False)
        if straight:
            slit = np.vstack([slit, _walk(np.array([tip, (0.0, specimen.bounds[3])]), zone, edge, closed=False)[1:]])
    else:
        bodies = [*bodies, notch]
    rim = np.vstack([_walk(body, zone, edge, closed=True) for body in bodies])
    rim = rim[_on_material(specimen, rim)]
    if len(slit):
        far = cKDTree(slit).query(rim)[0] > 0.5 * edge_size(rim, zone, edge)
        rim = rim[far]
    return np.vstack([slit, _thinned(rim, zone, edge)]), len(slit)


def _on_material(specimen: Specimen, rim: np.ndarray) -> np.ndarray:
    """Which boundary points really bound material: not those of the mouth's gap."""
    half = specimen.notch_width / 2
    gap = (np.abs(rim[:, 0]) < half * (1 - 1e-9)) & (rim[:, 1] < 1e-9)
    return ~gap


def _thinned(points: np.ndarray, zone: Zone, edge: float) -> np.ndarray:
    """Boundary points of which none are nearly double (where two outlines meet)."""
    kept = np.ones(len(points), bool)
    for a, b in sorted(cKDTree(points).query_pairs(0.3 * edge)):
        if kept[a]:
            kept[b] = False
    return points[kept]


def _walk(line: np.ndarray, zone: Zone, edge: float, closed: bool) -> np.ndarray:
    """Points along a polyline at the wanted distance; sharp corners are kept."""
    if closed and not np.allclose(line[0], line[-1]):
        line = np.vstack([line, line[:1]])
    found = [line[:1]]
    for piece in _smooth_pieces(line):
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(piece, axis=0).T))])
        fine = np.linspace(0, way[-1], max(int(np.ceil(way[-1] / (0.05 * edge))), 2) + 1)
        path = np.column_stack([np.interp(fine, way, piece[:, k]) for k in (0, 1)])
        count = np.concatenate([[0.0], np.cumsum(np.diff(fine) / edge_size(path[1:], zone, edge))])
        number = max(round(count[-1]), 1)
        stop = np.interp(np.arange(1, number + 1) * count[-1] / number, count, fine)
        found.append(np.column_stack([np.interp(stop, fine, path[:, k]) for k in (0, 1)]))
    points = np.vstack(found)
    return points[:-1] if closed else points


def _smooth_pieces(line: np.ndarray) -> list[np.ndarray]:
    """A polyline cut at its sharp corners; polygons that stand for curves stay whole."""
    line = line[np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > 1e-9])]
    run = np.diff(line, axis=0)
    run /= np.hypot(*run.T)[:, None]
    sharp = np.flatnonzero(np.sum(run[1:] * run[:-1], axis=1) < SHARP) + 1
    ends = np.concatenate([[0], sharp, [len(line) - 1]])
    return [line[a : b + 1] for a, b in pairwise(ends.tolist())]


def _scatter(specimen: Specimen, zone: Zone, edge: float, wall: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Random points inside, as dense as the wanted edge asks for."""
    x0, y0, x1, y1 = specimen.bounds
    count = int((x1 - x0) * (y1 - y0) / (np.sqrt(3) / 2 * edge**2))
    place = rng.uniform((x0, y0), (x1, y1), (count, 2))
    place = place[rng.uniform(size=count) < (edge / edge_size(place, zone, edge)) ** 2]
    return place[_clear(place, specimen, zone, edge, wall)]


def _clear(points: np.ndarray, specimen: Specimen, zone: Zone, edge: float, wall: np.ndarray) -> np.ndarray:
    """Which points lie inside and not too near to the boundary."""
    far = cKDTree(wall).query(points)[0] > NEAREST * edge_size(points, zone, edge)
    return specimen.contains(points) & far


def _triangles(points: np.ndarray, specimen: Specimen) -> np.ndarray:
    """Counter-clockwise triangles of the points whose centres are material."""
    corners = Delaunay(points).simplices.astype(np.int64)
    area = areas(points, corners)
    corners[area < 0] = corners[area < 0][:, [0, 2, 1]]
    corner = points[corners]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    firm = (np.abs(area) > FLATTEST * longest**2) & specimen.contains(corner.mean(axis=1))
    return corners[firm]


def _smoothed(points: np.ndarray, fixed: int, corners: np.ndarray, zone: Zone, edge: float) -> np.ndarray:
    """Every free point moved to the mean of the triangles around it, weighted by area over wanted area."""
    weight = np.abs(areas(points, corners)) / edge_size(points[corners].mean(axis=1), zone, edge) ** 2
    middle = points[corners].mean(axis=1)
    total, sums = np.zeros(len(points)), np.zeros((len(points), 2))
    for k in range(3):
        np.add.at(total, corners[:, k], weight)
        np.add.at(sums, corners[:, k], weight[:, None] * middle)
    moved = points.copy()
    free = np.arange(len(points)) >= fixed
    free &= total > 0
    moved[free] = sums[free] / total[free, None]
    return moved


def _check_slit(mesh: Mesh, slit: np.ndarray) -> None:
    """The notch must be a row of edges."""
    if not slit.size:
        return
    ends, _ = mesh.inner_edges
    there = set(map(tuple, ends.tolist()))
    wanted = [tuple(sorted(pair)) for pair in zip(slit[:-1].tolist(), slit[1:].tolist(), strict=True)]
    missing = [pair for pair in wanted if pair not in there]
    if missing:
        raise ConvergenceError(
            f"{len(missing)} of {len(wanted)} pieces of the notch are no edges of the mesh: finer edges"
        )
