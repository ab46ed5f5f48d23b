"""Single stones in a mask of aggregate: touching ones split by a watershed, small ones left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

NECK = 0.8
"""Two stones are one where the neck between them is wider than this share of the smaller one's width."""

SMALLEST_STONE = 2.36e-3
"""m; aggregate below this sieve is part of the mastic (Hill et al. 2017, "Discrete Element Modeling")."""


@dataclass(frozen=True)
class Stones:
    """Numbered stones.

    Parameters
    ----------
    number : (rows, cols) int32 array; 1 … count in a stone, 0 elsewhere
    count : int
    split : int; how many stones more than connected blobs the watershed found
    small : int; how many stones were left out for their size
    """

    number: np.ndarray
    count: int
    split: int
    small: int


def find_stones(aggregate: np.ndarray, smallest_px: float, neck: float = NECK) -> Stones:
    """Number the stones in a mask, splitting touching ones and leaving out small ones.

    The distance to the nearest pixel outside the mask is flooded from its maxima; two basins stay apart
    only where the distance at the pass between them is below `neck` times that at the lower of their
    summits (dynamics of the maxima, relative to the stone, so that rough outlines do not over-split), and
    the pass lies at least one pixel below it.

    Parameters
    ----------
    aggregate : (rows, cols) bool array
    smallest_px : float, px; smallest diameter of the circle of equal area
    neck : float; 0 never splits, 1 splits at every maximum

    Returns
    -------
    Stones, numbered in the order of their first pixel
    """
    blobs = cv2.connectedComponents(aggregate.astype(np.uint8), connectivity=8)[0] - 1
    basin = _basins(_depth(aggregate), aggregate, neck)
    pieces = int(basin.max())
    area = np.bincount(basin.ravel(), minlength=pieces + 1)
    keep = area >= np.pi / 4 * smallest_px**2
    keep[0] = False
    number = np.zeros(pieces + 1, np.int32)
    number[keep] = np.arange(1, keep.sum() + 1)
    return Stones(number[basin], int(keep.sum()), pieces - blobs, pieces - int(keep.sum()))


def without_small(mask: np.ndarray, diameter_px: float) -> np.ndarray:
    """The mask without the connected parts whose area is below that of a circle of the diameter."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    keep = stats[:, cv2.CC_STAT_AREA] >= np.pi / 4 * diameter_px**2
    keep[0] = False
    return keep[label]


def _depth(mask: np.ndarray) -> np.ndarray:
    """Distance (px) from each pixel to the nearest one outside the mask; the image's border is no outside."""
    distance = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    reach = float(np.hypot(*mask.shape))  # a mask without any outside has infinite distance
    return cv2.GaussianBlur(np.minimum(distance, reach), (0, 0), 1.0)


def _basins(depth: np.ndarray, mask: np.ndarray, neck: float) -> np.ndarray:
    """Watershed basins of the depth inside the mask, shallow ones merged; int array, 0 outside, from 1 on."""
    inside = np.flatnonzero(mask)
    out = np.zeros(mask.size, np.int32)
    if inside.size == 0:
        return out.reshape(mask.shape)
    local = np.full(mask.size, -1, np.int32)
    local[inside] = np.arange(inside.size)
    grid = local.reshape(mask.shape)
    height = depth.ravel()[inside]
    summit, basin = np.unique(_climb(grid, height), return_inverse=True)
    group = _merge(height[summit], *_passes(grid, height, basin), neck)
    out[inside] = _in_order(group[basin]) + 1
    return out.reshape(mask.shape)


def _neighbours(grid: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs of 8-neighbours with both numbers ≥ 0, as two arrays of numbers for each of four directions."""
    for a, b in (
        (grid[:, :-1], grid[:, 1:]),
        (grid[:-1], grid[1:]),
        (grid[:-1, :-1], grid[1:, 1:]),
        (grid[:-1, 1:], grid[1:, :-1]),
    ):
        both = (a >= 0) & (b >= 0)
        yield a[both], b[both]


def _climb(grid: np.ndarray, height: np.ndarray) -> np.ndarray:
    """The summit each pixel reaches by always stepping to its highest neighbour."""
    parent = np.arange(height.size, dtype=np.int32)
    best = height.copy()
    for a, b in _neighbours(grid):
        for here, there in ((a, b), (b, a)):
            better = height[there] > best[here]
            best[here[better]] = height[there[better]]
            parent[here[better]] = there[better]
    while not np.array_equal(further := parent[parent], parent):
        parent = further
    return parent


def _passes(grid: np.ndarray, height: np.ndarray, basin: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The highest pass between each two adjacent basins: (first, second, height), highest first."""
    crossings = []
    for a, b in _neighbours(grid):
        between = basin[a] != basin[b]
        crossings.append((a[between], b[between]))
    a, b = (np.concatenate(side) for side in zip(*crossings, strict=True))
    level = np.minimum(height[a], height[b])
    pair = np.sort(np.column_stack([basin[a], basin[b]]), axis=1)
    order = np.lexsort((pair[:, 1], pair[:, 0], -level))
    _, first = np.unique(pair[order], axis=0, return_index=True)
    keep = order[np.sort(first)]
    return pair[keep, 0], pair[keep, 1], level[keep]


def _merge(summit: np.ndarray, first: np.ndarray, second: np.ndarray, level: np.ndarray, neck: float) -> np.ndarray:
    """Join basins over the passes, highest first, unless both rise clearly above the pass; (basins,) group."""
    root = list(range(summit.size))
    top = summit.tolist()

    def find(k: int) -> int:
        while root[k] != k:
            root[k] = root[root[k]]
            k = root[k]
        return k

    for a, b, height in zip(first.tolist(), second.tolist(), level.tolist(), strict=True):
        a, b = find(a), find(b)
        lower, higher = (a, b) if top[a] <= top[b] else (b, a)
        if a != b and (height > neck * top[lower] or top[lower] - height < 1.0):
            root[lower] = higher
    return np.array([find(k) for k in range(summit.size)])


def _in_order(label: np.ndarray) -> np.ndarray:
    """Renumber labels from 0 in the order of their first appearance."""
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty(first.size, np.intp)
    rank[np.argsort(first)] = np.arange(first.size)
    return rank[inverse]
