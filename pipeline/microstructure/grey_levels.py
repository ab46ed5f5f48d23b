"""Thresholds between the grey levels of the phases, and whether there are phases at all."""

from __future__ import annotations

import cv2
import numpy as np

BIMODAL = 0.8
"""Largest valley, relative to the lower of its two peaks, at which grey levels count as two populations.

Noise, texture and uneven light give 0.95 to 1, blurred tomograms of concrete 0.15 to 0.5."""


def otsu_threshold(values: np.ndarray) -> float:
    """The threshold with the largest variance between the two classes (Otsu 1979); values above it are bright.

    Parameters
    ----------
    values : array, not negative; 16-bit resolution of its range is used
    """
    scale = 65535 / max(float(np.max(values)), 1e-30)
    levels = np.rint(np.asarray(values, float).ravel() * scale).astype(np.uint16).reshape(-1, 1)
    threshold, _ = cv2.threshold(levels, 0, 65535, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return float(threshold + 0.5) / scale


def even_pixels(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The half of the masked pixels where the image changes least: inside of phases, not mixtures at their edges.

    Where more than half change by less than a fiftieth of the image's range from pixel to pixel, all those.
    """
    slope = np.hypot(cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(image, cv2.CV_32F, 0, 1, scale=1 / 8))
    low, high = np.percentile(image[mask], [1, 99])
    return mask & (slope <= max(float(np.median(slope[mask])), (high - low) / 50))


def valley(values: np.ndarray, threshold: float) -> float:
    """Depth of the histogram between its peaks on both sides of a threshold, over the lower peak.

    0: two populations apart; 1: a single one. The histogram has 64 classes between the 0.2 and 99.8
    percentiles and is smoothed over two of them.
    """
    low, high = np.percentile(values, [0.2, 99.8])
    if not low < threshold < high:
        return 1.0
    count, _ = np.histogram(values, 64, (low, high))
    smooth = cv2.GaussianBlur(
        count.astype(np.float32).reshape(1, -1), (0, 0), 2, borderType=cv2.BORDER_CONSTANT
    ).ravel()
    cut = int((threshold - low) / (high - low) * 64)
    left, right = int(np.argmax(smooth[: cut + 1])), cut + int(np.argmax(smooth[cut:]))
    return float(smooth[left : right + 1].min() / max(min(smooth[left], smooth[right]), 1e-12))


def void_threshold(values: np.ndarray, threshold: float) -> float | None:
    """Where voids end: between the darker phase and a population clearly darker than it; None without one.

    Clearly darker: below the phase's median by six of its robust standard deviations, with a gap. The
    threshold lies halfway between the two medians, or somewhat lower (a dark stone may lie halfway), where
    there are at most a quarter as many pixels as around the median of the voids.

    Parameters
    ----------
    values : array; grey levels of even pixels
    threshold : float; between the two main phases
    """
    dark = values[values <= threshold]
    if dark.size < 100:
        return None
    lower, middle, upper = np.percentile(dark, [25, 50, 75])
    spread = min(middle - lower, upper - middle) / 0.6745
    deep = dark[dark < middle - 6 * spread]
    if deep.size < 10:
        return None
    void = float(np.median(deep))
    band = 0.1 * (middle - void)
    around = np.count_nonzero(np.abs(dark - void) < band)
    for share in (0.5, 0.4, 0.3):
        level = float(void + share * (middle - void))
        if np.count_nonzero(np.abs(dark - level) < band) <= 0.25 * around:
            return level
    return None
