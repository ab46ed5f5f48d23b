"""Uneven light taken out of a photograph of a material of two phases."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.microstructure.grey_levels import even_pixels, otsu_threshold, valley

_SAMPLES = 50_000  # pixels that carry the fit; more change nothing and cost time
_FEW = 0.15  # share of the pixels up to which a dark class may be voids
_CLEAR = 0.5  # valley below which the rest is parted, so that uneven light is not


def nearest_inside(mask: np.ndarray) -> np.ndarray:
    """Flat index of the nearest pixel inside the mask, for every pixel; (rows, cols) int array."""
    _, label = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    source = np.zeros(int(label.max()) + 1, np.intp)
    source[label[mask]] = np.flatnonzero(mask)
    return source[label]


def fill_outside(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The image with each pixel outside the mask set to the value of the nearest one inside; float32."""
    values = image.astype(np.float32)
    return values if mask.all() else values.ravel()[nearest_inside(mask)]


def denoise(image: np.ndarray, size_px: float) -> np.ndarray:
    """A median against single pixels, then a Gaussian of standard deviation size/2; float32.

    Parameters
    ----------
    image : (rows, cols) float32 array
    size_px : float, px; below 1 the image is returned as it is
    """
    if size_px < 1:
        return image
    median = cv2.medianBlur(image, 3 if size_px < 3 else 5)
    return cv2.GaussianBlur(median, (0, 0), size_px / 2)


def flatten(image: np.ndarray, mask: np.ndarray, degree: int, rounds: int = 8) -> np.ndarray:
    """Divide the image by its illumination, the exponential of a polynomial in column and row.

    Illumination and phases are found in turn: with the phases of the last round (Otsu), the polynomial is
    fitted by least squares to the logarithm of each pixel over the mean of its phase, leaving out what lies
    beyond three robust standard deviations. So stones gathered on one side are not taken for light, as
    they are by a blurred background (the idea of Wells et al. 1996, IEEE TMI 15, for bias fields).

    Parameters
    ----------
    image : (rows, cols) float32 array, not negative
    mask : (rows, cols) bool array; the specimen
    degree : int; 0 leaves the image as it is
    rounds : int

    Returns
    -------
    (rows, cols) float32 array, with the mean logarithm of the image inside the mask
    """
    if degree == 0:
        return image
    row, column = np.nonzero(even_pixels(image, mask))
    step = max(row.size // _SAMPLES, 1)
    row, column = row[::step], column[::step]
    log = np.log(np.maximum(image, 0.01 * float(np.median(image[mask])) + 1e-6))
    x, y = (_powers(n, degree) for n in (image.shape[1], image.shape[0]))
    terms = [(i, total - i) for total in range(1, degree + 1) for i in range(total + 1)]
    basis = np.column_stack([x[column, i] * y[row, j] for i, j in terms])
    light = _fit_light(basis, log[row, column].astype(float), rounds)
    coefficient = np.zeros((degree + 1, degree + 1))
    coefficient[tuple(zip(*terms, strict=True))] = light
    return np.exp(log - (y @ coefficient.T @ x.T).astype(np.float32))


def _powers(count: int, degree: int) -> np.ndarray:
    """Powers 0 … `degree` of a coordinate from −1 to 1 over `count` pixels; (count, degree + 1)."""
    return np.linspace(-1, 1, count)[:, None] ** np.arange(degree + 1)


def _fit_light(basis: np.ndarray, log: np.ndarray, rounds: int) -> np.ndarray:
    """Coefficients of the illumination's logarithm, found in turn with the phases, together with their levels."""
    light = np.linalg.lstsq(basis, log - log.mean(), rcond=None)[0]
    for turn in range(rounds):
        phase = _phases(np.exp(log - basis @ light), part=turn > 0)
        design = np.column_stack([basis, phase == 0, phase == 1])
        solid = phase >= 0
        found = np.linalg.lstsq(design[solid], log[solid], rcond=None)[0]
        error = np.abs(log - design @ found)
        use = solid & (error <= 3 * 1.4826 * np.median(error[solid]) + 1e-9)
        light = np.linalg.lstsq(design[use], log[use], rcond=None)[0][: basis.shape[1]]
    return light


def _phases(values: np.ndarray, part: bool) -> np.ndarray:
    """0 and 1 for the darker and brighter phase, −1 for what may be voids.

    A dark class of at most `_FEW` of the pixels may be voids. The rest then is one phase, or, where it may be
    parted and has two clear populations, two.
    """
    bright = values > otsu_threshold(values)
    if np.mean(~bright) > _FEW:
        return bright.astype(int)
    rest = values[bright]
    threshold = otsu_threshold(rest)
    phase = np.where(bright, 0, -1)
    if part and valley(rest, threshold) < _CLEAR:
        phase[bright] = rest > threshold
    return phase
