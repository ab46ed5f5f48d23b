"""First guesses: where a patch of the reference lies now, to a whole pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

_FLAT = 1e-9  # of the variance; where there is less, round-off is all that is left
_UNIQUE = 0.1  # by so much ZNCC the best place must beat every other one


@dataclass(frozen=True)
class Place:
    """Where a patch was found: shift (u, v) in px, its ZNCC and that of the best other place."""

    shift: tuple[float, float]
    zncc: float
    runner_up: float

    @property
    def certain(self) -> bool:
        return self.zncc - self.runner_up > _UNIQUE


def find(
    reference: np.ndarray,
    current: np.ndarray,
    centre: tuple[int, int],
    half: int,
    reach: int,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Place | None:
    """Search a square patch within `reach` px of a first shift, by zero-normalised cross-correlation.

    Parameters
    ----------
    reference, current : (rows, columns) arrays
    centre : (column, row) in the reference
    half : int, px; half the size of the patch, cut at the border of the picture
    reach : int, px
    shift : (u, v), px

    Returns
    -------
    Place, or None where the patch has no contrast or nothing is left to search.
    """
    column, row = centre
    left, top = min(half, column), min(half, row)
    patch = reference[row - top : row + half + 1, column - left : column + half + 1].astype(float)
    c0, r0 = column - left + round(shift[0]) - reach, row - top + round(shift[1]) - reach
    c1, r1 = c0 + 2 * reach + patch.shape[1], r0 + 2 * reach + patch.shape[0]
    c0, r0 = max(c0, 0), max(r0, 0)
    window = current[r0 : max(r1, 0), c0 : max(c1, 0)].astype(float)
    if patch.std() == 0 or window.shape[0] < patch.shape[0] or window.shape[1] < patch.shape[1]:
        return None
    zncc = _correlate(window, patch - patch.mean())
    peak_r, peak_c = np.unravel_index(np.argmax(zncc), zncc.shape)
    others = zncc.copy()
    away = max(3, half // 3)
    others[max(peak_r - away, 0) : peak_r + away + 1, max(peak_c - away, 0) : peak_c + away + 1] = -1
    found = (float(peak_c + c0 - column + left), float(peak_r + r0 - row + top))
    return Place(found, float(zncc[peak_r, peak_c]), float(others.max()))


def _correlate(window: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """ZNCC of a zero-mean patch at every place in the window where it fits."""
    window = window - window.mean()
    rows, columns = patch.shape
    valid = (window.shape[0] - rows + 1, window.shape[1] - columns + 1)
    size = [fft.next_fast_len(n, real=True) for n in window.shape]
    product = fft.rfft2(window, size) * np.conj(fft.rfft2(patch, size))
    overlap = fft.irfft2(product, size)[: valid[0], : valid[1]]
    total, square = _box(window, rows, columns), _box(window**2, rows, columns)
    energy = np.maximum(square - total**2 / patch.size, _FLAT * np.var(window) * patch.size)
    return overlap / np.sqrt(energy * np.sum(patch**2))


def _box(values: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Sums over every window of rows × columns."""
    sums = np.pad(np.cumsum(np.cumsum(values, axis=0), axis=1), ((1, 0), (1, 0)))
    return sums[rows:, columns:] - sums[:-rows, columns:] - sums[rows:, :-columns] + sums[:-rows, :-columns]
