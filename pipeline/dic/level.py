"""Levelling: a simulated field goes through the camera and the correlation before it is compared with a measured one,
so that both carry the same filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField
from pipeline.dic.camera import View
from pipeline.dic.core import core
from pipeline.dic.correlation import Correlation
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Speckle, photograph
from pipeline.dic.track import track


@dataclass(frozen=True, eq=False)
class Mesh:
    """Material points joined to triangles.

    A triangle whose sides are whole moves as a plane; one with a broken side falls apart into the three corners'
    shares, each moving with its corner, and what opens between them is a gap.

    Parameters
    ----------
    points : (k, 2) array, px
    largest : float; triangles with a side longer than this times the median side are not material
    """

    points: np.ndarray
    largest: float = 1.8

    def __post_init__(self) -> None:
        if len(self.points) < 3:
            raise InputError(f"a field needs at least 3 material points to be photographed, got {len(self.points)}")

    @cached_property
    def delaunay(self) -> Delaunay:
        return Delaunay(self.points)

    @cached_property
    def material(self) -> np.ndarray:
        """(t,) bool; which triangles of `delaunay` are material."""
        corner = self.points[self.delaunay.simplices]
        side = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
        return np.all(side <= self.largest * np.median(side), axis=1)

    def moved(self, displacement: np.ndarray, broken: np.ndarray | None = None) -> MovedMesh:
        """The mesh after displacements (k, 2), px, with broken pairs (b, 2) of points."""
        return MovedMesh(self, displacement, self._whole(broken))

    def _whole(self, broken: np.ndarray | None) -> np.ndarray:
        simplices = self.delaunay.simplices.astype(np.int64)
        if broken is None or not len(broken):
            return self.material
        count = len(self.points)
        ends = np.sort(np.asarray(broken, np.int64), axis=1)
        sides = np.sort(np.stack([simplices, np.roll(simplices, 1, axis=1)], axis=-1), axis=-1)
        torn = np.isin(sides[..., 0] * count + sides[..., 1], ends[:, 0] * count + ends[:, 1])
        return self.material & ~torn.any(axis=1)


@dataclass(frozen=True, eq=False)
class MovedMesh:
    """A mesh in motion; `whole` (t,) bool tells which triangles still hold together."""

    mesh: Mesh
    displacement: np.ndarray
    whole: np.ndarray

    def origin_on(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Material points (n, 2) seen on a square raster, row by row, and whether there is any (n,)."""
        place = np.column_stack([np.tile(columns, rows.size), np.repeat(rows, columns.size)])
        simplices = self.mesh.delaunay.simplices[self.whole].astype(np.int32)
        number = (
            core()
            .cover(
                np.ascontiguousarray(self.mesh.points + self.displacement),
                np.ascontiguousarray(simplices),
                column0=float(columns[0]),
                row0=float(rows[0]),
                step=float(columns[1] - columns[0]),
                columns=columns.size,
                rows=rows.size,
            )
            .ravel()
        )
        origin, seen = np.full(place.shape, np.nan), number >= 0
        origin[seen] = self._in_triangle(simplices[number[seen]], place[seen])
        self._in_pieces(origin, seen, place)
        return origin, seen

    def displacement_at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How material points move, exactly as they are photographed.

        Parameters
        ----------
        points : (n, 2) array, px; undeformed

        Returns
        -------
        displacement : (n, 2) array, px; NaN where there is no material
        material : (n,) bool
        """
        mesh = self.mesh
        triangle = mesh.delaunay.find_simplex(points)
        material = (triangle >= 0) & mesh.material[triangle]
        corner = mesh.delaunay.simplices[triangle]
        before = mesh.points[corner]
        sides = np.stack([before[:, 1] - before[:, 0], before[:, 2] - before[:, 0]], axis=2)
        share = np.linalg.solve(sides, (points - before[:, 0])[:, :, None])[:, :, 0]
        moved = self.displacement[corner]
        smooth = moved[:, 0] + np.einsum("nk,nkd->nd", share, moved[:, 1:] - moved[:, :1])
        own = np.argmin(np.linalg.norm(before - points[:, None], axis=2), axis=1)
        node = corner[np.arange(len(points)), own]
        torn = self.displacement[node] + np.einsum("nij,nj->ni", self._gradient[node], points - mesh.points[node])
        found = np.where(self.whole[triangle][:, None], smooth, torn)
        return np.where(material[:, None], found, np.nan), material

    def _in_triangle(self, corner: np.ndarray, place: np.ndarray) -> np.ndarray:
        """The point of the undeformed triangle with the same shares of the corners."""
        now = (self.mesh.points + self.displacement)[corner]
        before = self.mesh.points[corner]
        sides = np.stack([now[:, 1] - now[:, 0], now[:, 2] - now[:, 0]], axis=2)
        share = np.linalg.solve(sides, (place - now[:, 0])[:, :, None])[:, :, 0]
        return before[:, 0] + np.einsum("nk,nkd->nd", share, before[:, 1:] - before[:, :1])

    def _in_pieces(self, origin: np.ndarray, seen: np.ndarray, place: np.ndarray) -> None:
        """Fill in what is seen of torn triangles; changes `origin` and `seen`, which the caller made."""
        torn = self.mesh.material & ~self.whole
        corners = np.unique(self.mesh.delaunay.simplices[torn])
        left = np.flatnonzero(~seen)
        if not corners.size or not left.size:
            return
        gradient = self._gradient
        count = min(3, corners.size)
        near = cKDTree((self.mesh.points + self.displacement)[corners]).query(place[left], k=count)[1]
        for node in corners[near.reshape(-1, count)].T:
            arm = place[left] - self.mesh.points[node] - self.displacement[node]
            start = self.mesh.points[node] + np.linalg.solve(np.eye(2) + gradient[node], arm[..., None])[..., 0]
            triangle = self.mesh.delaunay.find_simplex(start)
            corner = self.mesh.delaunay.simplices[triangle]
            own = np.argmin(np.linalg.norm(self.mesh.points[corner] - start[:, None], axis=2), axis=1)
            mine = (triangle >= 0) & torn[triangle] & (corner[np.arange(len(own)), own] == node) & ~seen[left]
            origin[left[mine]], seen[left[mine]] = start[mine], True

    @cached_property
    def _gradient(self) -> np.ndarray:
        """(k, 2, 2) displacement gradient at the points, the mean over the whole triangles around."""
        corner = self.mesh.delaunay.simplices[self.whole]
        before, moved = self.mesh.points[corner], self.displacement[corner]
        sides = np.stack([before[:, 1] - before[:, 0], before[:, 2] - before[:, 0]], axis=1)
        change = np.stack([moved[:, 1] - moved[:, 0], moved[:, 2] - moved[:, 0]], axis=1)
        each = np.linalg.solve(sides, change).transpose(0, 2, 1)
        total, number = np.zeros((len(self.mesh.points), 2, 2)), np.zeros(len(self.mesh.points))
        for k in range(3):
            np.add.at(total, corner[:, k], each)
            np.add.at(number, corner[:, k], 1)
        return total / np.maximum(number, 1)[:, None, None]


@dataclass(frozen=True)
class Levelling:
    """The camera and the correlation that a simulated field is sent through.

    Parameters
    ----------
    shape : (rows, columns) of the pictures
    view : View
    settings : Settings
    camera : Camera; noise-free unless given, so that only the filter is added
    seed : int; of the speckle and the noise
    """

    shape: tuple[int, int]
    view: View
    settings: Settings = field(default_factory=Settings)
    camera: Camera = field(default_factory=lambda: Camera(noise=0.0))
    seed: int = 0

    def correlations(
        self, position: np.ndarray, displacement: np.ndarray, broken: Sequence[np.ndarray | None] | None = None
    ) -> list[Correlation]:
        """What the correlation sees of a simulated field, one result a frame.

        Parameters
        ----------
        position : (k, 2) array, m; undeformed material points, in specimen coordinates
        displacement : (frames, k, 2) array, m
        broken : one (b, 2) int array a frame, optional; pairs of points that no longer hold together
        """
        random = np.random.default_rng(self.seed)
        speckle = Speckle.scattered(self.shape, random)
        mesh = Mesh(self.view.pixel(position))
        torn = broken if broken is not None else [None] * len(displacement)

        def frames():  # type: ignore[no-untyped-def]  # pictures one at a time
            still = mesh.moved(np.zeros(position.shape))
            yield photograph(speckle, self.shape, still, self.camera, random, self.settings.threads)
            for now, pairs in zip(displacement, torn, strict=True):
                moved = mesh.moved(self.view.pixel_vector(now), pairs)
                yield photograph(speckle, self.shape, moved, self.camera, random, self.settings.threads)

        return list(track(frames(), self.settings))

    def field_at(
        self,
        points: np.ndarray,
        position: np.ndarray,
        displacement: np.ndarray,
        abscissa: np.ndarray,
        broken: Sequence[np.ndarray | None] | None = None,
    ) -> DisplacementField:
        """The levelled field at chosen points (n, 2), m; arguments as in `correlations`, `abscissa` (frames,)."""
        series = self.correlations(position, displacement, broken)
        seen = [c.at(self.view.pixel(points)) for c in series]
        return DisplacementField(
            points=np.asarray(points, float),
            displacement=np.array([self.view.vector(moved) for moved, _, _ in seen]),
            valid=np.array([valid for _, _, valid in seen]),
            std=np.array([std for _, std, _ in seen]) * self.view.metre_per_px,
            abscissa=np.asarray(abscissa, float),
        )
