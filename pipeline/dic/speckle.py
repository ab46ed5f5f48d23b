"""Photographs with a known answer: speckle evaluated at displaced points, so that no interpolation enters the truth."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.core.errors import InputError, UnavailableError
from pipeline.dic.core import core
from pipeline.dic.motion import Affine, Cracked, Cut, Motion, Seen, origin_of


@dataclass(frozen=True, eq=False)
class Speckle:
    """A sum of Gaussian blobs on a plain background, known at every point.

    Parameters
    ----------
    blobs : (m, 4) array; column, row, standard deviation (px) and grey value of each blob
    background : float, grey values
    """

    blobs: np.ndarray
    background: float = 0.0

    @classmethod
    def scattered(
        cls,
        shape: tuple[int, int],
        random: np.random.Generator,
        *,
        area: float = 45.0,
        sigma: tuple[float, float] = (1.3, 2.2),
        grey: tuple[float, float] = (48.0, 94.0),
        background: float = 30.0,
        margin: float = 80.0,
    ) -> Speckle:
        """Blobs at random over a picture of `shape` (rows, columns) and a `margin` (px) around it.

        One blob in `area` (px²); standard deviations (px) and grey values are uniform in the given ranges.
        """
        rows, columns = shape[0] + 2 * margin, shape[1] + 2 * margin
        count = int(rows * columns / area)
        place = random.uniform(-margin, [columns - margin, rows - margin], (count, 2))
        return cls(np.column_stack([place, random.uniform(*sigma, count), random.uniform(*grey, count)]), background)

    @cached_property
    def _pattern(self):  # type: ignore[no-untyped-def]  # compiled object
        return core().Pattern(np.ascontiguousarray(self.blobs, float))

    def grey(self, points: np.ndarray, threads: int = 1) -> np.ndarray:
        """Grey values (n,) at points (n, 2)."""
        return self.background + self._pattern.evaluate(np.ascontiguousarray(points, float), threads)


@dataclass(frozen=True)
class Lens:
    """Radial distortion x' = c + (x − c)(1 + k r²/R²), fixed to the camera.

    Parameters
    ----------
    centre : (column, row), px
    corner : float, px; R, the distance at which the relative distortion is k
    strength : float; k
    """

    centre: tuple[float, float] = (0.0, 0.0)
    corner: float = 1.0
    strength: float = 0.0

    def distort(self, points: np.ndarray) -> np.ndarray:
        """Where ideal points (n, 2) appear."""
        arm = points - np.asarray(self.centre)
        return points + arm * (self.strength * np.sum(arm**2, axis=1) / self.corner**2)[:, None]

    def straighten(self, points: np.ndarray) -> np.ndarray:
        """The ideal points (n, 2) that appear at the given ones; Newton on the radius."""
        arm = points - np.asarray(self.centre)
        seen = np.hypot(*arm.T) / self.corner
        radius = seen.copy()
        for _ in range(20):
            radius -= (radius + self.strength * radius**3 - seen) / (1 + 3 * self.strength * radius**2)
        share = np.divide(radius, seen, out=np.ones_like(seen), where=seen > 0)
        return np.asarray(self.centre) + arm * share[:, None]


@dataclass(frozen=True)
class Camera:
    """What the camera adds: blur, brightness, noise, rounding, distortion.

    Parameters
    ----------
    noise : float, grey values; standard deviation of each pixel
    gain, offset : float; grey → gain × grey + offset (grey values)
    blur : float, px; standard deviation of a Gaussian point spread, edges of gaps included
    fill : int; samples across a pixel in each direction (1: the value at the centre)
    bits : int; depth, 8 or 16; None keeps real numbers
    gap : float, grey values; what is seen where no material is
    lens : Lens
    """

    noise: float = 2.0
    gain: float = 1.0
    offset: float = 0.0
    blur: float = 0.0
    fill: int = 1
    bits: int | None = 8
    gap: float = 8.0
    lens: Lens = field(default_factory=Lens)

    def __post_init__(self) -> None:
        if self.noise < 0 or self.blur < 0 or self.fill < 1 or self.bits not in (None, 8, 16):
            raise InputError(
                f"a camera has noise ≥ 0, blur ≥ 0, fill ≥ 1 and 8, 16 or no bits; got noise {self.noise:g}, "
                f"blur {self.blur:g}, fill {self.fill}, bits {self.bits}"
            )

    def develop(self, grey: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """The exposed picture with gain, offset, noise and rounding."""
        seen = self.gain * grey + self.offset
        if self.noise:
            seen = seen + random.normal(0, self.noise, grey.shape)
        if self.bits is None:
            return seen
        return np.clip(np.rint(seen), 0, 2**self.bits - 1).astype(f"uint{self.bits}")


def photograph(
    speckle: Speckle,
    shape: tuple[int, int],
    motion: Motion | Seen,
    camera: Camera,
    random: np.random.Generator,
    threads: int = 1,
) -> np.ndarray:
    """A picture (rows, columns) of the speckle after a motion."""
    return camera.develop(expose(speckle, shape, motion, camera, threads), random)


def expose(
    speckle: Speckle, shape: tuple[int, int], motion: Motion | Seen, camera: Camera, threads: int = 1
) -> np.ndarray:
    """The grey values that reach the sensor, before gain, noise and rounding; (rows, columns) float."""
    fill, extra = camera.fill, int(np.ceil(4 * camera.blur))
    axes = [(np.arange((n + 2 * extra) * fill) + 0.5) / fill - 0.5 - extra for n in shape]
    grey = np.empty((axes[0].size, axes[1].size))
    band = max(1, 2**20 // axes[1].size)  # rows at a time: bounded memory for large pictures
    for first in range(0, axes[0].size, band):
        rows = axes[0][first : first + band]
        grey[first : first + band] = _seen(speckle, axes[1], rows, motion, camera, threads)
    if camera.blur:
        from scipy.ndimage import gaussian_filter

        grey = gaussian_filter(grey, camera.blur * fill, truncate=4.0)
    grey = grey.reshape(shape[0] + 2 * extra, fill, shape[1] + 2 * extra, fill).mean(axis=(1, 3))
    return grey[extra : extra + shape[0], extra : extra + shape[1]]


def _seen(
    speckle: Speckle, columns: np.ndarray, rows: np.ndarray, motion: Motion | Seen, camera: Camera, threads: int
) -> np.ndarray:
    """Grey values (rows, columns) before blur."""
    if isinstance(motion, Seen):
        if camera.lens.strength:
            raise UnavailableError("a simulated field is photographed without lens distortion: set lens.strength to 0")
        origin, material = motion.origin_on(columns, rows)
    else:
        at = np.column_stack([np.tile(columns, rows.size), np.repeat(rows, columns.size)])
        origin, material = origin_of(motion, camera.lens.straighten(at) if camera.lens.strength else at)
    grey = np.full(len(origin), camera.gap)
    grey[material] = speckle.grey(origin[material], threads)
    return grey.reshape(rows.size, columns.size)


@dataclass(frozen=True)
class Pair:
    """Two photographs and the motion between them."""

    reference: np.ndarray
    deformed: np.ndarray
    motion: Motion
    speckle: Speckle
    camera: Camera

    def truth(self, points: np.ndarray) -> np.ndarray:
        """Displacement (n, 2) of the material seen at points (n, 2) of the reference, as the camera sees it, px."""
        lens = self.camera.lens
        ideal = lens.straighten(points)
        moved = ideal + self.motion.displacement(ideal, self.motion.sheet_of(ideal))
        return lens.distort(moved) - points


def photograph_pair(
    motion: Motion,
    shape: tuple[int, int],
    seed: int,
    camera: Camera | None = None,
    camera_after: Camera | None = None,
    speckle: Speckle | None = None,
) -> Pair:
    """Photographs before and after a motion, of scattered speckle unless another is given."""
    random = np.random.default_rng(seed)
    camera = camera or Camera()
    speckle = speckle or Speckle.scattered(shape, random)
    after = camera_after or camera
    return Pair(
        photograph(speckle, shape, Affine(), replace(camera, lens=after.lens), random),
        photograph(speckle, shape, motion, after, random),
        motion,
        speckle,
        after,
    )


def smooth_pair(size: int = 1000, seed: int = 1) -> Pair:
    """The smooth pair of the contract: t = (0.37, −0.21) px, gradients 2e-3, 1e-3, −5e-4, −6e-4."""
    centre = ((size - 1) / 2, (size - 1) / 2)
    return photograph_pair(Affine((0.37, -0.21), ((2e-3, 1e-3), (-5e-4, -6e-4)), centre), (size, size), seed)


def crack_pair(size: int = 1000, seed: int = 1, theta: float = 0.004) -> Pair:
    """The crack pair of the contract: column 499.5 below row 400, halves moved apart by ±θ (row − 400)₊."""
    cut = Cut(
        tip=(size / 2 - 0.5, 0.4 * size), angle=np.pi / 2, jump=(1.0, 0.0), profile=lambda xi: 2 * theta * xi
    )  # ξ runs down the rows, η towards smaller columns
    return photograph_pair(Cracked((cut,)), (size, size), seed)
