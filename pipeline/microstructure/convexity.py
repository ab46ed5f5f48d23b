"""Telling stones from the matrix between them by the shape of their common boundary."""

from __future__ import annotations

from enum import StrEnum

import cv2
import numpy as np

from pipeline.core.errors import InputError
from pipeline.microstructure.stones import without_small

LEAST_LEAD = 0.05
"""Lead below which neither phase counts as the convex one; sections and tomograms of concrete give 0.4 to 0.6."""

STRAIGHT = 0.005
"""Departure of the averaged share from one half below which a boundary counts as straight."""


class AggregateIs(StrEnum):
    """Which of the two main grey levels the stones have."""

    DARK = "dark"
    BRIGHT = "bright"
    AUTO = "auto"  # the one on the convex side of the longer part of the common boundary


def convex_lead(first: np.ndarray, inside: np.ndarray, reach_px: float) -> float:
    """How much more of the boundary of two phases is convex seen from the first than from the second; −1 to 1.

    Around each pair of neighbouring pixels of different phases the share of the first is averaged with a
    Gaussian of standard deviation `reach_px`, and again along the boundary against the steps of the raster:
    below one half the first is convex there. Stones are convex along most of their outline, the matrix
    between them is not, however much there is of either.

    Parameters
    ----------
    first : (rows, cols) bool array
    inside : (rows, cols) bool array; first or second phase, the rest is neither
    reach_px : float, px
    """
    weight = _smooth(inside, reach_px)
    bend = _smooth(first & inside, reach_px) / np.maximum(weight, 1e-6) - 0.5
    deep = inside & (weight > 0.99)
    length, bent = np.zeros(first.shape, np.float32), np.zeros(first.shape, np.float32)
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        pair = deep[a] & deep[b] & (first[a] != first[b])
        for side in (a, b):
            length[side] += pair
            bent[side] += pair * (bend[a] + bend[b]) / 2
    edge = length > 0
    along = _smooth(bent, reach_px)[edge] / np.maximum(_smooth(length, reach_px)[edge], 1e-6)
    lead = np.sum(length[edge] * ((along < -STRAIGHT) * 1.0 - (along > STRAIGHT)))
    return float(lead / max(np.sum(length), 1.0))


def _smooth(values: np.ndarray, reach_px: float) -> np.ndarray:
    return cv2.GaussianBlur(values.astype(np.float32), (0, 0), reach_px)


def choose_aggregate(
    dark: np.ndarray, solid: np.ndarray, asked: AggregateIs, smallest_px: float
) -> tuple[AggregateIs, float]:
    """Dark or bright, and the convex lead of that choice.

    Parameters
    ----------
    dark : (rows, cols) bool array; the darker phase
    solid : (rows, cols) bool array; both phases
    asked : AggregateIs
    smallest_px : float, px; diameter of the smallest stone; specks below a quarter of it are overlooked

    Raises
    ------
    InputError
        if it was left open and the boundary does not tell
    """
    speck = smallest_px / 4
    clean = without_small(solid & ~without_small(solid & ~dark, speck), speck)
    lead = convex_lead(clean, solid, max(smallest_px / 10, 1.0))
    if asked != AggregateIs.AUTO:
        return AggregateIs(asked), lead if asked == AggregateIs.DARK else -lead
    if abs(lead) < LEAST_LEAD:
        raise InputError(
            f"dark and bright parts of the photograph are equally round (lead {lead:+.2f}, at least {LEAST_LEAD:g} is "
            "asked for): which are stones cannot be told; say so with aggregate_is, or bring a label image"
        )
    return (AggregateIs.DARK if lead > 0 else AggregateIs.BRIGHT), abs(lead)
