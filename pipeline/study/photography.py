"""Simulated fields before a camera: particles joined to a mesh, torn where bonds have parted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.core.problem import Problem
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.dic.camera import View
from pipeline.dic.grid import Grid
from pipeline.dic.level import Mesh, MovedMesh
from pipeline.dic.settings import Settings
from pipeline.dic.speckle import Camera, Speckle, photograph
from pipeline.store.sections import PixelFrame
from pipeline.study.observation import PARTED

SHOWN = (57 * MM, 44 * MM)  # width and height before the camera: 1300 × 1000 px of 0.0439 mm, Hill et al. 2017
BELOW = 10  # px of background under the mouth
BEHIND = 18 * MM  # of the notch before its tip, where its mouth is too far to be shown
BLUR = 0.5  # px; of a lens
FLICKER = (0.005, 0.5)  # standard deviations of gain, and of offset in grey values, from picture to picture


def view_of(frame: PixelFrame) -> View:
    """How a camera looks at the specimen, in m and rad."""
    return View(frame.mm_per_px * MM, frame.origin_px, float(np.deg2rad(frame.rotation_deg)), frame.mirror)


def camera_frame(specimen: Specimen, mm_per_px: float) -> tuple[tuple[int, int], PixelFrame]:
    """Shape (rows, columns) of the pictures and how they lie: the notch upright in the middle.

    Shown are the paper's 57 × 44 mm, or the specimen where it is smaller: from the mouth on, or, where the tip lies
    deeper than that, from 18 mm before it.
    """
    x0, y0, x1, y1 = specimen.bounds
    low = y0 if specimen.tip[1] < SHOWN[1] / 2 else specimen.tip[1] - BEHIND
    pitch = mm_per_px * MM
    columns, rows = round(min(SHOWN[0], x1 - x0) / pitch), round(min(SHOWN[1], y1 - low) / pitch)
    origin = ((columns - 1) / 2, float(f"{rows - 1 - (BELOW if low == y0 else 0) + low / pitch:.9g}"))
    return (rows, columns), PixelFrame(mm_per_px=mm_per_px, origin_px=origin)


@dataclass(frozen=True, eq=False)
class Sheet:
    """The particles of a problem as a sheet of material that tears.

    An edge of the mesh without a bond (the notch), or whose bond has changed its length by more than a tenth of its
    delta_max, does not hold: as in `observe_solution`, so that both see the same flanks.

    Parameters
    ----------
    problem : Problem
    view : View
    """

    problem: Problem
    view: View

    @cached_property
    def mesh(self) -> Mesh:
        return Mesh(self.view.pixel(self.problem.particles.position))

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges (e, 2) of the mesh and the bond along each, −1 where there is none."""
        corner = self.mesh.delaunay.simplices.astype(np.int64)
        edges = np.unique(np.sort(np.vstack([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), 1), axis=0)
        count = self.problem.particles.count
        pairs = self.problem.bonds.pairs.astype(np.int64)
        key, wanted = pairs[:, 0] * count + pairs[:, 1], edges[:, 0] * count + edges[:, 1]
        order = np.argsort(key)
        found = order[np.minimum(np.searchsorted(key[order], wanted), key.size - 1)]
        return edges, np.where(key[found] == wanted, found, -1)

    def torn(self, displacement: np.ndarray) -> np.ndarray:
        """Edges (t, 2) of the mesh that do not hold after displacements (n, 2) in m of the particles."""
        edges, bond = self._edges
        one, two = self.problem.bonds.pairs.T
        before = self.problem.particles.position
        now = before + displacement
        change = np.abs(np.hypot(*(now[two] - now[one]).T) - np.hypot(*(before[two] - before[one]).T))
        parted = change > PARTED * self.problem.law.delta_max
        return edges[(bond < 0) | parted[bond]]

    def moved(self, displacement: np.ndarray) -> MovedMesh:
        """The sheet after displacements (n, 2) in m of the particles."""
        return self.mesh.moved(self.view.pixel_vector(displacement), self.torn(displacement))


@dataclass(frozen=True, eq=False)
class Film:
    """Speckle images of a sheet in motion.

    Parameters
    ----------
    sheet : Sheet
    shape : (rows, columns), px
    displacement : (loaded, n, 2) array, m; of the particles in the frames under load
    still : int; frames of the unloaded specimen before them
    noise : float, grey values
    """

    sheet: Sheet
    shape: tuple[int, int]
    displacement: np.ndarray
    still: int
    noise: float
    camera: Camera = field(default_factory=lambda: Camera(blur=BLUR))

    def __len__(self) -> int:
        return self.still + len(self.displacement)

    def motions(self) -> Iterator[MovedMesh]:
        """How the sheet lies in each frame."""
        at_rest = self.sheet.moved(np.zeros((self.sheet.problem.particles.count, 2)))
        for number in range(len(self)):
            yield at_rest if number < self.still else self.sheet.moved(self.displacement[number - self.still])

    def pictures(self, rng: np.random.Generator, threads: int = 1) -> Iterator[np.ndarray]:
        """One picture after the other; speckle, noise and flicker come from `rng`."""
        of_speckle, of_noise = rng.spawn(2)
        speckle = Speckle.scattered(self.shape, of_speckle)
        for motion in self.motions():
            bright, dark = of_noise.standard_normal(2) * FLICKER
            camera = replace(self.camera, noise=self.noise, gain=1 + bright, offset=dark)
            yield photograph(speckle, self.shape, motion, camera, of_noise, threads)

    def truth(self, settings: Settings) -> tuple[np.ndarray, Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        """Exact displacements at the grid points on the material.

        Returns
        -------
        points : (n, 2) array, m
        frames : displacement (n, 2) in m, whether there is material (n,) and zeros (n,), one frame after the other
        """
        grid = Grid.over(self.shape, settings).points
        view, at_rest = self.sheet.view, self.sheet.moved(np.zeros((self.sheet.problem.particles.count, 2)))
        points = grid[at_rest.displacement_at(grid)[1]]

        def frames() -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
            for motion in self.motions():
                moved, material = motion.displacement_at(points)
                yield view.vector(moved), material, np.zeros(len(points))

        return view.point(points), frames()
