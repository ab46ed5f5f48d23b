"""The opening of the notch as the camera sees it, and with it the camera's clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.field import DisplacementField
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.dic.gauge import opening
from pipeline.dic.synchronise import synchronise
from pipeline.store.bundle import Bundle

if TYPE_CHECKING:
    from pipeline.study.measurement import Series

FEET = 12  # points that a foot of the gauge needs on its side
SUBSETS = 2  # edges of a subset that a foot reaches


@dataclass(frozen=True, eq=False)
class Opening:
    """What a clip gauge at the given height would have shown.

    Parameters
    ----------
    value, std : (frames,) arrays, m
    height : float, m; y of its feet
    at_gauge : bool; the feet are those of the specimen's own gauge
    """

    value: np.ndarray
    std: np.ndarray
    height: float
    at_gauge: bool


@dataclass(frozen=True, eq=False)
class Timing:
    """The camera's clock against the record's.

    Parameters
    ----------
    offset : float, s; an image stamped t shows the specimen at record time t − offset
    std : float or None, s; None where the offset was given, or there is no record
    how : "estimated", "given" or "no record"
    gain : float; opening seen over CMOD of the record
    zero : float, m; opening seen when the record shows none
    rms : float, m; of what is left
    opening : Opening or None, where the notch is not in the pictures
    """

    offset: float
    std: float | None
    how: str
    gain: float = 1.0
    zero: float = 0.0
    rms: float = float("nan")
    opening: Opening | None = None


def notch_opening(specimen: Specimen, series: Series, factor: float) -> Opening | None:
    """The opening across the notch in every frame, at the gauge or as near to it as points were measured.

    Parameters
    ----------
    specimen : Specimen
    series : Series
    factor : float; on the standard deviations
    """
    points = series.view.point(series.grid.points)
    edge = series.settings.subset_size_px * series.view.metre_per_px
    reach = max(min(SUBSETS * edge, specimen.notch_length), specimen.gauge_length / 2)
    half = specimen.gauge_length / 2
    height = _height(points[series.ever], specimen, half, reach)
    if height is None:
        return None
    feet = np.array([(-half, height), (half, height)])
    near = series.ever & (np.min([np.hypot(*(points - f).T) for f in feet], axis=0) <= reach)
    value, std = np.zeros(len(series)), np.zeros(len(series))
    for frame in series.frames():
        r = frame.result
        moved = series.view.vector(np.nan_to_num(r.warp[near, :2]))
        spread = factor * np.sqrt(np.mean(r.std[near] ** 2, axis=1)) * series.view.metre_per_px
        field = DisplacementField(
            points[near], moved[None], r.valid[near][None], np.nan_to_num(spread)[None], np.zeros(1)
        )
        (value[frame.number],), (std[frame.number],) = opening(field, feet[0], feet[1], reach, edge)
    return Opening(value, std, height, bool(abs(height - specimen.gauge_y) < 1e-9))


def _height(points: np.ndarray, specimen: Specimen, half: float, reach: float) -> float | None:
    """The height (m) nearest to the gauge at which both feet have points, below the tip; None where there is none."""
    for height in np.arange(specimen.gauge_y, specimen.tip[1], reach / 4):
        sides = [points[np.sign(points[:, 0]) == side] for side in (-1, 1)]
        if all(np.count_nonzero(np.hypot(*(p - (s * half, height)).T) <= 0.8 * reach) >= FEET
               for p, s in zip(sides, (-1, 1), strict=True)):  # fmt: skip
            return float(height)
    return None


def synchronised(bundle: Bundle, stamp: np.ndarray, seen: Opening | None) -> Timing:
    """The camera's clock, from the opening that camera and record have both seen.

    Raises
    ------
    InputError, ConvergenceError
        where it cannot be told, with what to do
    """
    given = bundle.dic.sync_offset_s
    if bundle.curve is None:
        return Timing(given or 0.0, None, "no record" if given is None else "given", opening=seen)
    if given is not None:
        return _given(given, stamp, seen, bundle.curve)
    if seen is None:
        raise InputError(
            "the images do not show both flanks of the notch, so that the camera's clock cannot be found by its "
            "opening: give [dic] sync_offset_s"
        )
    try:
        found = synchronise(stamp, seen.value, bundle.curve, fit_gain=not seen.at_gauge)
    except (InputError, ConvergenceError) as error:
        raise type(error)(f"frames.csv against load_cmod.csv: {error}; or give [dic] sync_offset_s") from error
    return Timing(found.offset, found.std, "estimated", found.gain, found.zero, found.rms, seen)


def _given(offset: float, stamp: np.ndarray, seen: Opening | None, curve: LoadCurve) -> Timing:
    """What is left between the two at an offset that was given."""
    if seen is None:
        return Timing(offset, None, "given")
    cmod = curve.cmod_at(stamp - offset)
    left = (seen.value - cmod)[np.isfinite(cmod) & np.isfinite(seen.value)]
    zero = float(np.mean(left)) if left.size else 0.0
    rms = float(np.std(left)) if left.size else float("nan")
    return Timing(offset, None, "given", 1.0, zero, rms, seen)


def sentence(timing: Timing) -> str:
    """How the clock was found, in words."""
    if timing.how == "estimated":
        return f"camera {timing.offset:+.3f} ± {timing.std:.3f} s against the record"
    if timing.how == "given":
        return f"camera {timing.offset:+.3f} s against the record, as [dic] sync_offset_s says"
    return "no load record: times are the camera's own"


def remarks(timing: Timing) -> list[str]:
    """What a user should know of the opening that was seen."""
    seen = timing.opening
    if seen is None:
        return ["the images do not show the flanks of the notch: the opening was not measured"]
    if not seen.at_gauge:
        return [
            f"the gauge is not in the images: the opening was measured at y = {seen.height / MM:.1f} mm and is "
            f"{timing.gain:.2f} times the record's CMOD"
        ]
    return []
