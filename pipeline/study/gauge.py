"""The opening of the notch as the camera sees it, and with it the camera's clock."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.field import DisplacementField
from pipeline.core.specimen import Specimen
from pipeline.dic.correlation import Correlation
from pipeline.dic.gauge import opening, rigid_opening
from pipeline.dic.synchronise import Synchronisation, synchronise
from pipeline.store.bundle import Bundle

if TYPE_CHECKING:
    from pipeline.study.measurement import Series

FEET = 12  # points that a foot of the gauge needs on its side
SUBSETS = 2  # edges of a subset that a foot reaches
HIGH = 3  # edges of a subset that an arm must be high, to show how it turns
OFF_SCALE = 0.1  # camera and clip gauge span the same points: a gain that differs more from 1 is a wrong scale


@dataclass(frozen=True, eq=False)
class Opening:
    """What a clip gauge would have shown.

    Parameters
    ----------
    value, std : (frames,) arrays, m
    shown : bool; the feet of the gauge are in the pictures, else they were carried by the arms as by rigid bodies
    """

    value: np.ndarray
    std: np.ndarray
    shown: bool


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
    doubt : str or None; why the offset should not be trusted
    """

    offset: float
    std: float | None
    how: str
    gain: float = 1.0
    zero: float = 0.0
    rms: float = float("nan")
    opening: Opening | None = None
    doubt: str | None = None


@dataclass(frozen=True, eq=False)
class NotchGauge:
    """A clip gauge read off correlated frames.

    Parameters
    ----------
    series : Series
    points : (n, 2) array, m; of the grid
    feet : (2, 2) array, m; left and right
    use : (n,) bool array; the points that carry the feet
    arms : those of the left and the right arm, or None where points lie around the feet themselves
    reach, edge : float, m; of a foot, and of a subset
    """

    series: Series
    points: np.ndarray
    feet: np.ndarray
    use: np.ndarray
    arms: tuple[np.ndarray, np.ndarray] | None
    reach: float
    edge: float

    @classmethod
    def of(cls, specimen: Specimen, series: Series) -> NotchGauge | None:
        """At the specimen's own gauge; None where too little of the flanks of its notch is in the pictures."""
        points, half = series.view.point(series.grid.points), specimen.gauge_length / 2
        edge = series.settings.subset_size_px * series.view.metre_per_px
        feet = np.array([(-half, specimen.gauge_y), (half, specimen.gauge_y)])
        reach = max(min(SUBSETS * edge, specimen.notch_length), half)
        if all(_stands(points[series.ever], foot, reach) for foot in feet):
            near = np.min([np.hypot(*(points - f).T) for f in feet], axis=0) <= reach
            return cls(series, points, feet, series.ever & near, None, reach, edge)
        arms = _arms(points, series.ever, specimen, edge)
        return arms and cls(series, points, feet, arms[0] | arms[1], arms, reach, edge)

    def opening(self, result: Correlation) -> tuple[float, float]:
        """The opening in one frame and its standard deviation by camera noise, m."""
        field = self._part(result)
        if self.arms is None:
            (value,), (std,) = opening(field, self.feet[0], self.feet[1], self.reach, self.edge)
        else:
            sides = self.arms[0][self.use], self.arms[1][self.use]
            (value,), (std,) = rigid_opening(field, self.feet[0], self.feet[1], sides, self.edge)
        return float(value), float(std)

    def _part(self, result: Correlation) -> DisplacementField:
        """The points that carry the feet, in specimen coordinates, m."""
        view, use = self.series.view, self.use
        spread = np.sqrt(np.mean(result.std[use] ** 2, axis=1)) * view.metre_per_px
        return DisplacementField(
            self.points[use],
            view.vector(np.nan_to_num(result.warp[use, :2]))[None],
            result.valid[use][None],
            np.nan_to_num(spread)[None],
            np.zeros(1),
        )


def _stands(points: np.ndarray, foot: np.ndarray, reach: float) -> bool:
    """Whether a foot of the gauge has enough points around it, on its own side of the notch."""
    own = points[np.sign(points[:, 0]) == np.sign(foot[0])]
    return bool(np.count_nonzero(np.hypot(*(own - foot).T) <= 0.8 * reach) >= FEET)


def _arms(
    points: np.ndarray, ever: np.ndarray, specimen: Specimen, edge: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Points of the arms on both sides of the notch, thinned to one a subset, clear of the notch and of the tip."""
    clear = max(specimen.notch_width / 2, 0.0) + edge
    low = ever & (points[:, 1] < specimen.tip[1] - edge) & (np.abs(points[:, 0]) > clear)
    thin = _one_a_cell(points, low, edge)
    arms = thin & (points[:, 0] < 0), thin & (points[:, 0] > 0)
    long = all(np.count_nonzero(arm) >= FEET and np.ptp(points[arm, 1]) >= HIGH * edge for arm in arms)
    return arms if long else None


def _one_a_cell(points: np.ndarray, use: np.ndarray, edge: float) -> np.ndarray:
    """The first of the used points in each square of a subset's size: more would only say the same again."""
    number = np.flatnonzero(use)
    cell = np.floor(points[number] / edge).astype(int)
    found = np.zeros(len(points), bool)
    found[number[np.unique(cell, axis=0, return_index=True)[1]]] = True
    return found


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
            "too few subsets lie on both flanks of the notch, so that the camera's clock cannot be found by its "
            "opening: check [camera] mm_per_px and origin_px, roi_px and grid_step_px, or give [dic] sync_offset_s"
        )
    try:
        away = not seen.shown
        found = synchronise(stamp, seen.value, bundle.curve, fit_gain=away, fit_bending=away)
    except (InputError, ConvergenceError) as error:
        raise type(error)(f"frames.csv against load_cmod.csv: {error}; or give [dic] sync_offset_s") from error
    doubt = _doubt(stamp, seen, bundle.curve, found)
    return Timing(found.offset, found.std, "estimated", found.gain, found.zero, found.rms, seen, doubt)


def _doubt(stamp: np.ndarray, seen: Opening, curve: LoadCurve, found: Synchronisation) -> str | None:
    """Why an offset should not be trusted: another scale explains the images far better, or its error is too large."""
    if seen.shown:
        with contextlib.suppress(InputError, ConvergenceError):
            free = synchronise(stamp, seen.value, curve, fit_gain=True)
            if free.rms < found.rms / 2 and (wrong := _off_scale(free.gain)):
                return wrong
    every = float(np.median(np.diff(stamp)))
    if found.std > every:
        return (
            f"the camera's clock is known to ± {found.std:.3g} s only, and an image was taken every {every:.3g} s: "
            "check clock.png, the order of the images and their times, or give [dic] sync_offset_s"
        )
    return None


def _off_scale(gain: float) -> str | None:
    """What a gain that differs too much from one says."""
    if abs(gain - 1) <= OFF_SCALE:
        return None
    return (
        f"the images show {gain:.2f} times the CMOD of the record: check [camera] mm_per_px, gauge_length_mm and the "
        "units of cmod_mm; until then neither fields nor clock are to be trusted"
    )


def _given(offset: float, stamp: np.ndarray, seen: Opening | None, curve: LoadCurve) -> Timing:
    """What is left between the two at an offset that was given."""
    if seen is None:
        return Timing(offset, None, "given")
    cmod = curve.cmod_at(stamp - offset)
    both = np.isfinite(cmod) & np.isfinite(seen.value)
    left = (seen.value - cmod)[both]
    zero = float(np.mean(left)) if left.size else 0.0
    rms = float(np.std(left)) if left.size else float("nan")
    doubt = None
    if seen.shown and left.size > 2 and np.ptp(cmod[both]) > 0:
        slope, rest = np.polyfit(cmod[both], seen.value[both], 1)
        if np.std(seen.value[both] - slope * cmod[both] - rest) < rms / 2:
            doubt = _off_scale(float(slope))
    return Timing(offset, None, "given", 1.0, zero, rms, seen, doubt)


def sentence(timing: Timing) -> str:
    """How the clock was found, in words."""
    if timing.how == "estimated":
        return f"camera {timing.offset:+.3f} ± {timing.std:.3f} s against the record"
    if timing.how == "given":
        return f"camera {timing.offset:+.3f} s against the record, as [dic] sync_offset_s says"
    return "no load record: times are the camera's own"


def remarks(timing: Timing) -> list[str]:
    """What a user should know of the opening that was seen."""
    seen, doubt = timing.opening, [timing.doubt] if timing.doubt else []
    if seen is None:
        return ["the images do not show enough of both flanks of the notch: the opening was not measured"]
    if not seen.shown:
        return [
            "the gauge is not in the images: its opening was told from how the flanks of the notch turn"
            + (f", {timing.gain:.2f} times the record's CMOD beside a part that follows the load"
               if timing.how == "estimated" else ""),
            *doubt,
        ]  # fmt: skip
    return doubt
