"""Grey values that can be correlated."""

from __future__ import annotations

import numpy as np

from pipeline.core.errors import InputError

_LEAST_PX = 16  # rows and columns
_LEAST_SPAN, _MOST_SPAN = 1e-4, 1e12  # of the grey values: against the largest, and in all
_LEAST_LEVELS = 8  # different grey values; a photograph of 3 bits


def checked(image: np.ndarray, what: str, like: np.ndarray | None = None) -> np.ndarray:
    """The grey values as float32, rows × columns.

    Parameters
    ----------
    image : array
    what : str; the picture's name in refusals
    like : array, optional; a picture whose size it must have

    Raises
    ------
    InputError
        for anything but a finite picture of 16 × 16 pixels or more whose grey values differ
    """
    image = np.asarray(image)
    refusal = _shape_refusal(image, like) or _value_refusal(image)
    if refusal:
        raise InputError(f"{what} {refusal}")
    return np.ascontiguousarray(image, np.float32)


def _shape_refusal(image: np.ndarray, like: np.ndarray | None) -> str:
    if image.ndim != 2:
        return f"has {image.ndim} dimensions (shape {image.shape}), expected rows × columns of grey values"
    size = f"has {image.shape[1]} × {image.shape[0]} px"
    if image.dtype.kind not in "uif":
        return f"holds values of type {image.dtype}, expected whole or real grey values"
    if min(image.shape) < _LEAST_PX:
        return f"{size}, expected at least {_LEAST_PX} × {_LEAST_PX}"
    if like is not None and image.shape != like.shape:
        other = f"the reference {like.shape[1]} × {like.shape[0]}"
        return f"{size}, {other}: pictures of one test must have one size"
    return ""


def _value_refusal(image: np.ndarray) -> str:
    if not np.isfinite(image).all():
        return f"holds {int((~np.isfinite(image)).sum())} values that are not finite: fill or crop them"
    low, high = float(image.min()), float(image.max())
    if low == high:
        return f"is blank: every pixel has the grey value {low:g}"
    if not _LEAST_SPAN * max(-low, high) < high - low < _MOST_SPAN:
        return (
            f"has grey values from {low:.9g} to {high:.9g}, which single precision cannot hold: subtract what they "
            "have in common and scale them to 16 bits"
        )
    few = image[:: max(1, image.shape[0] // 128), :: max(1, image.shape[1] // 128)]  # quick, and nearly always enough
    if np.unique(few).size < _LEAST_LEVELS and (levels := np.unique(image).size) < _LEAST_LEVELS:
        return f"has {levels} different grey values, which tell no displacement: use it as the camera took it"
    return ""
