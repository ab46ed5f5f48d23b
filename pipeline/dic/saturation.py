"""Saturated pixels: the light was more or less than the camera can tell, so the grey value says nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_LEAST = 4  # pixels; fewer are not worth leaving out
_HEAP = 2.0  # so much more frequent than the next one is the grey value in which all that lies beyond heaps up


@dataclass(frozen=True)
class Range:
    """The grey values that a picture can tell: those between floor and ceiling, both excluded."""

    floor: float = -np.inf
    ceiling: float = np.inf

    @classmethod
    def of(cls, grey: np.ndarray) -> Range:
        """The range of a picture (rows, columns).

        Of whatever depth a camera is, the light beyond what it can tell heaps up in its largest value, and that
        below in 0, while the frequencies of other pictures fall towards both ends.
        """
        top, bottom = float(grey.max()), float(grey.min())
        low = bottom == 0 and _heaps(grey == bottom, grey[grey > bottom], np.min)
        return cls(bottom if low else -np.inf, top if _heaps(grey == top, grey[grey < top], np.max) else np.inf)

    def beyond(self, grey: np.ndarray) -> np.ndarray:
        """Which pixels are saturated."""
        return (grey <= self.floor) | (grey >= self.ceiling)

    def remark(self, grey: np.ndarray, least: float = 0.05) -> str:
        """What to say of the picture where more than a share of `least` is saturated, else nothing."""
        ends = {self.ceiling: grey >= self.ceiling, self.floor: grey <= self.floor}
        shares = {value: float(np.mean(there)) for value, there in ends.items()}
        said = [f"{share:.0%} of it is at grey value {value:g}" for value, share in shares.items() if share > least]
        return f" ({' and '.join(said)}: photograph in another light)" if said else ""

    def calmed(self, grey: np.ndarray) -> np.ndarray:
        """The picture with saturated pixels at its median, where they attract no search."""
        if np.isinf(self.floor) and np.isinf(self.ceiling):
            return grey
        return np.where(self.beyond(grey), np.median(grey), grey)


def _heaps(end: np.ndarray, rest: np.ndarray, nearest: Callable[[np.ndarray], float]) -> bool:
    """Do the pixels at the end of the range outnumber those of the next grey value?"""
    number = np.count_nonzero(end)
    return bool(number >= _LEAST and rest.size and number >= _HEAP * np.count_nonzero(rest == nearest(rest)))
