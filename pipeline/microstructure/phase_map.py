"""The phases of a cut face, pixel by pixel, in specimen coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.microstructure.placement import ImagePlacement
from pipeline.microstructure.stones import NECK, SMALLEST_STONE, Stones, find_stones

IMAGE_PHASES = (Phase.OUTSIDE, Phase.MASTIC, Phase.AGGREGATE, Phase.VOID)


@dataclass(frozen=True)
class PhaseMap:
    """What each pixel of an image of the specimen is made of.

    Parameters
    ----------
    label : (rows, cols) uint8 array of `Phase`: outside, mastic, aggregate or void
    stone : (rows, cols) int32 array; number of the stone, 0 where there is none
    placement : ImagePlacement; where the image lies on the specimen
    """

    label: np.ndarray
    stone: np.ndarray
    placement: ImagePlacement

    def __post_init__(self) -> None:
        if self.label.ndim != 2 or self.label.shape != self.stone.shape:
            raise InputError(
                f"labels and stone numbers of a phase map must be images of one size, got {self.label.shape} and "
                f"{self.stone.shape}"
            )

    def at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Phase (n,) uint8 and stone number (n,) int32 of the pixel nearest to each point (n, 2), in m.

        Beyond the image the phase is OUTSIDE and the stone 0.
        """
        column, row = np.floor(self.placement.to_pixel(points) + 0.5).T
        rows, columns = self.label.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        phase = np.zeros(len(points), np.uint8)
        stone = np.zeros(len(points), np.int32)
        where = row[inside].astype(np.intp), column[inside].astype(np.intp)
        phase[inside], stone[inside] = self.label[where], self.stone[where]
        return phase, stone

    def share(self, phase: Phase) -> float:
        """Share of a phase in the area that is not outside; NaN where all is outside."""
        area = np.count_nonzero(self.label != Phase.OUTSIDE)
        return np.count_nonzero(self.label == phase) / area if area else float("nan")

    @property
    def stones(self) -> int:
        """How many stones there are."""
        return np.unique(self.stone[self.stone > 0]).size


def from_labels(
    label: np.ndarray, placement: ImagePlacement, smallest_stone: float = SMALLEST_STONE, neck: float = NECK
) -> tuple[PhaseMap, Stones]:
    """The phase map of a label image: 0 outside, 1 mastic, 2 aggregate, 3 void.

    Touching stones are split and numbered; stones whose equivalent diameter is below `smallest_stone`
    become mastic.

    Parameters
    ----------
    label : (rows, cols) integer array
    placement : ImagePlacement
    smallest_stone : float, m
    neck : float; see `stones.find_stones`

    Returns
    -------
    PhaseMap, and the Stones it was numbered with (how many were split and left out)

    Raises
    ------
    InputError
        if the image is not grey, holds other values, or has no material
    """
    checked = _checked_labels(label)
    stones = find_stones(checked == Phase.AGGREGATE, smallest_stone / placement.metres_per_px, neck)
    small = (checked == Phase.AGGREGATE) & (stones.number == 0)
    return PhaseMap(np.where(small, np.uint8(Phase.MASTIC), checked), stones.number, placement), stones


def _checked_labels(label: np.ndarray) -> np.ndarray:
    if label.ndim != 2 or not np.issubdtype(label.dtype, np.integer) or label.size == 0:
        raise InputError(
            f"a label image must have one channel of whole numbers, got shape {label.shape} of {label.dtype}: save it "
            "as an 8-bit grey image with 0 outside, 1 mastic, 2 aggregate, 3 void"
        )
    strange = np.setdiff1d(label, IMAGE_PHASES)
    if strange.size:
        raise InputError(
            f"the label image holds {_list(strange)}: only 0 outside, 1 mastic, 2 aggregate and 3 void are allowed; "
            "a photograph belongs into specimen.png or specimen.tif"
        )
    if not np.isin(label, (Phase.MASTIC, Phase.AGGREGATE)).any():
        raise InputError("the label image holds neither mastic (1) nor aggregate (2): there is no material in it")
    return label.astype(np.uint8)


def _list(values: np.ndarray) -> str:
    shown = ", ".join(str(v) for v in values[:8])
    return f"the values {shown}" + (f" and {values.size - 8} more" if values.size > 8 else "")
