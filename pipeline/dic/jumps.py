"""Where a displacement field jumps: at each node and for each direction of a line, two planes with a step between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, signal, spatial

_ANGLES = 16  # half a turn
_FLANK = 6  # nodes on either side beyond the blind band
_WIDEST = 8
_SPIKE = 15  # nodes; patches up to half of it are taken for spikes


@dataclass(frozen=True, eq=False)
class Raster:
    """A field on a regular raster, gaps filled, spikes taken out.

    Parameters
    ----------
    origin : (2,) array; coordinates of node (0, 0)
    step : float; between nodes, in the unit of the coordinates
    displacement : (rows, columns, 2) array
    known : (rows, columns) bool; nodes with a measured value
    """

    origin: np.ndarray
    step: float
    displacement: np.ndarray
    known: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, displacement: np.ndarray, valid: np.ndarray) -> Raster:
        """From scattered or gridded points (n, 2), each node takes the nearest valid point."""
        tree = spatial.cKDTree(points)
        step = float(np.median(tree.query(points, k=2)[0][:, 1]))
        origin = points.min(axis=0)
        columns, rows = np.rint((points.max(axis=0) - origin) / step).astype(int) + 1
        node = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1) * step + origin
        distance, nearest = spatial.cKDTree(points[valid]).query(node.reshape(-1, 2))
        value = displacement[valid][nearest].reshape(rows, columns, 2)
        return cls(origin, step, _without_spikes(value), (distance < 0.75 * step).reshape(rows, columns))

    def at(self, nodes: np.ndarray) -> np.ndarray:
        """Coordinates (k, 2) of nodes (k, 2), given as row, column."""
        return self.origin + self.step * nodes[:, ::-1]


def _without_spikes(value: np.ndarray) -> np.ndarray:
    """Small patches outside the range of the medians around them become the median; a crack's flanks stay."""
    calm = ndimage.median_filter(value, (_SPIKE, _SPIKE, 1))
    scatter = 1.4826 * np.median(np.abs(value - calm), axis=(0, 1)) + 1e-300
    around = (_SPIKE // 2 + 2, _SPIKE // 2 + 2, 1)
    low, high = ndimage.minimum_filter(calm, around), ndimage.maximum_filter(calm, around)
    spike = np.any((value < low - 8 * scatter) | (value > high + 8 * scatter), axis=-1)
    spike = ndimage.binary_dilation(spike, np.ones((3, 3))) & np.any(np.abs(value - calm) > 4 * scatter, axis=-1)
    return np.where(spike[..., None], calm, value)


@dataclass(frozen=True, eq=False)
class Jumps:
    """The step at every node, for the direction in which it is greatest.

    Parameters
    ----------
    size : (rows, columns) array; magnitude, in the unit of the displacement
    vector : (rows, columns, 2) array; displacement on the side of the normal minus the other
    angle : (rows, columns) array, rad; of the normal, in the coordinates of the points
    blind : int; nodes on either side of the line that were left out
    """

    size: np.ndarray
    vector: np.ndarray
    angle: np.ndarray
    blind: int

    @property
    def reach(self) -> int:
        """Nodes that a window reaches to either side."""
        return self.blind + _FLANK


def jumps(raster: Raster, blind: int | None = None) -> Jumps:
    """Steps of a raster; the width over which the field itself blurs a step is measured unless given (nodes)."""
    if blind is None:
        blind = _blur(raster, _steps(raster, 1))
    return _steps(raster, blind)


def kernel(angle: float, blind: int) -> np.ndarray:
    """Weights whose product with a window is the step of the least-squares fit of a plane and a step across a line."""
    reach = blind + _FLANK
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(float)
    across = x * np.cos(angle) + y * np.sin(angle)
    use = (np.hypot(x, y) <= reach + 0.5) & (np.abs(across) >= blind - 0.01)
    basis = np.column_stack([np.ones(use.sum()), x[use], y[use], 0.5 * np.sign(across[use])])
    weights = np.zeros(x.shape)
    weights[use] = np.linalg.pinv(basis)[3]
    return weights


def _steps(raster: Raster, blind: int) -> Jumps:
    reach = blind + _FLANK
    padded = np.pad(_without_plane(raster.displacement), ((reach, reach), (reach, reach), (0, 0)), mode="edge")
    size = np.full(raster.known.shape, -1.0)
    vector, normal = np.zeros(raster.displacement.shape), np.zeros(raster.known.shape)
    for angle in np.arange(_ANGLES) * np.pi / _ANGLES:
        weights = kernel(float(angle), blind)[::-1, ::-1, None]
        step = signal.fftconvolve(padded, weights, mode="valid", axes=(0, 1))
        now = np.linalg.norm(step, axis=-1)
        better = now > size
        size, normal = np.where(better, now, size), np.where(better, angle, normal)
        vector = np.where(better[..., None], step, vector)
    return Jumps(size, vector, normal, blind)


def _without_plane(value: np.ndarray) -> np.ndarray:
    """Rigid motion and mean strain make no step, but would make a kink where the border is continued."""
    row, column = np.indices(value.shape[:2])
    basis = np.column_stack([np.ones(row.size), row.ravel(), column.ravel()])
    plane = np.linalg.lstsq(basis, value.reshape(-1, 2), rcond=None)[0]
    return value - (basis @ plane).reshape(value.shape)


def _blur(raster: Raster, found: Jumps) -> int:
    """Half the width (nodes) over which the strongest steps are smeared: where the flanks' planes are reached."""
    inner = np.zeros(found.size.shape, bool)
    edge = _FLANK + _WIDEST
    inner[edge:-edge, edge:-edge] = True
    strong = np.argsort(np.where(inner, found.size, -1), axis=None)[-200:]
    at = np.arange(-edge, edge + 1)
    widths = []
    for row, column in zip(*np.unravel_index(strong, found.size.shape), strict=True):
        angle, direction = found.angle[row, column], found.vector[row, column]
        where = [row + at * np.sin(angle), column + at * np.cos(angle)]
        along = sum(ndimage.map_coordinates(raster.displacement[..., k], where, order=1) * direction[k] for k in (0, 1))
        widths.append(_half_width(at, along))
    return int(np.clip(np.ceil(np.median(widths)), 1, _WIDEST)) if widths else 1


def _half_width(at: np.ndarray, value: np.ndarray) -> float:
    """Half of the 10–90 % width of a blurred step with straight flanks."""
    low, high = (np.polyval(np.polyfit(at[part], value[part], 1), at) for part in (slice(0, 6), slice(-6, None)))
    share = (value - low) / np.where(np.abs(high - low) > 1e-300, high - low, 1e-300)
    inside = (share > 0.1) & (share < 0.9)
    return max(inside[3:-3].sum(), 1) / 2 + 0.5
