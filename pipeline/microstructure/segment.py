"""From the photograph of a cut face to its phases."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.microstructure.convexity import AggregateIs, choose_aggregate
from pipeline.microstructure.grey_levels import BIMODAL, even_pixels, otsu_threshold, valley, void_threshold
from pipeline.microstructure.illumination import denoise, fill_outside, flatten, nearest_inside
from pipeline.microstructure.phase_map import PhaseMap
from pipeline.microstructure.placement import ImagePlacement
from pipeline.microstructure.stones import NECK, SMALLEST_STONE, find_stones, without_small


@dataclass(frozen=True)
class SegmentSettings:
    """How a photograph is read.

    Parameters
    ----------
    aggregate_is : AggregateIs
    smallest_stone : float, m; diameter of equal area, smaller aggregate is mastic
    smallest_void : float; as a share of `smallest_stone`, smaller dark spots are what surrounds them
    hole : float; as a share of `smallest_stone`, other material enclosed in a stone and smaller belongs to it
    noise : float; as a share of `smallest_stone`, finer detail is noise; 0 leaves the image as it is
    light_degree : int; degree of the polynomial of the illumination, 0: even light
    largest_void_share : float; a dark population with a larger share of the area is a phase, not voids
    neck : float; see `stones.find_stones`
    """

    aggregate_is: AggregateIs = AggregateIs.AUTO
    smallest_stone: float = SMALLEST_STONE
    smallest_void: float = 1 / 4
    hole: float = 1 / 2
    noise: float = 1 / 12
    light_degree: int = 3
    largest_void_share: float = 0.15
    neck: float = NECK

    def __post_init__(self) -> None:
        if not self.smallest_stone > 0:
            raise InputError(f"smallest_stone = {self.smallest_stone * 1e3:g} mm must be positive")
        shares = (self.smallest_void, self.hole, self.noise, self.neck, self.largest_void_share)
        if not all(0 <= s <= 1 for s in shares) or self.light_degree < 0:
            raise InputError(f"shares of a segmentation must lie between 0 and 1 and degrees not below 0, got {self}")


@dataclass(frozen=True)
class Segmentation:
    """A phase map and how it came about.

    Parameters
    ----------
    phase_map : PhaseMap
    aggregate_is : AggregateIs; dark or bright
    threshold : float; between mastic and aggregate, in grey levels of the evenly lit image
    void_threshold : float or None; grey level below which is void, None where no voids were found
    valley : float; see `grey_levels.valley`, 0 clear, 1 none
    convex_lead : float; share of the boundary that is convex seen from the aggregate minus the rest
    thresholded_fraction : float; aggregate in the specimen's area right after the threshold
    aggregate_fraction : float; aggregate in the end
    void_fraction : float
    stones : int
    split : int; stones more than there were connected blobs
    small : int; stones below the smallest size, now mastic
    """

    phase_map: PhaseMap
    aggregate_is: AggregateIs
    threshold: float
    void_threshold: float | None
    valley: float
    convex_lead: float
    thresholded_fraction: float
    aggregate_fraction: float
    void_fraction: float
    stones: int
    split: int
    small: int


def segment(
    image: np.ndarray,
    placement: ImagePlacement,
    settings: SegmentSettings | None = None,
    mask: np.ndarray | None = None,
) -> Segmentation:
    """Find mastic, stones and voids in a photograph of a cut face.

    Noise and uneven light are taken out, Otsu's threshold parts the two main phases, a clearly darker
    population is void, small holes in stones are filled, touching stones are split, numbered, and left
    to the mastic below the smallest size (Hill et al. 2017, Fig. 7).

    Parameters
    ----------
    image : (rows, cols) or (rows, cols, 3 or 4) array of uint8 or uint16; colours in OpenCV's order
    placement : ImagePlacement
    settings : SegmentSettings, the default ones where not given
    mask : (rows, cols) bool array; where the specimen is, everywhere where not given

    Raises
    ------
    InputError
        for an image that is no photograph, blank, without two grey levels, or without a stone
    """
    settings = settings or SegmentSettings()
    grey = _grey(image)
    inside = _checked_mask(mask, grey.shape)
    _refuse_blank(grey, inside)
    smallest = settings.smallest_stone / placement.metres_per_px
    flat = flatten(denoise(fill_outside(grey, inside), settings.noise * smallest), inside, settings.light_degree)
    threshold, void_below, depth = _thresholds(flat, inside, settings.largest_void_share)
    void = inside & (flat < void_below) if void_below is not None else np.zeros_like(inside)
    dark = inside & ~void & (flat <= threshold)
    choice, lead = choose_aggregate(dark, inside & ~void, settings.aggregate_is, smallest)
    raw = dark if choice == AggregateIs.DARK else inside & ~void & ~dark
    void = without_small(void, settings.smallest_void * smallest)
    solid = _solid(raw, inside & ~void, settings.noise * smallest, settings.hole * smallest)
    stones = find_stones(solid, smallest, settings.neck)
    _refuse_stoneless(stones.count, settings.smallest_stone)
    label = np.select([~inside, void, stones.number > 0], [Phase.OUTSIDE, Phase.VOID, Phase.AGGREGATE], Phase.MASTIC)
    phase_map = _with_rim(label.astype(np.uint8), stones.number, inside, placement)
    return Segmentation(
        phase_map,
        choice,
        threshold,
        void_below,
        depth,
        lead,
        float(raw.sum() / inside.sum()),
        phase_map.share(Phase.AGGREGATE),
        phase_map.share(Phase.VOID),
        stones.count,
        stones.split,
        stones.small,
    )


def _grey(image: np.ndarray) -> np.ndarray:
    """One channel, as it came."""
    if not isinstance(image, np.ndarray) or image.dtype not in (np.uint8, np.uint16):
        kind = getattr(image, "dtype", type(image).__name__)
        raise InputError(f"a photograph must have 8 or 16 bit per channel, got {kind}: save it as such a PNG or TIFF")
    if image.ndim == 3 and image.shape[2] in (3, 4):
        return cv2.cvtColor(image[..., :3], cv2.COLOR_BGR2GRAY)
    if image.ndim == 3 and image.shape[2] == 1:
        return image[..., 0]
    if image.ndim != 2:
        raise InputError(f"a photograph must be grey or colour, got an array of shape {image.shape}")
    return image


def _checked_mask(mask: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    if mask is None:
        return np.ones(shape, bool)
    if mask.shape != shape or mask.dtype != bool:
        raise InputError(
            f"the specimen mask is {mask.dtype} of {mask.shape}, the photograph has {shape}: use a bool of that size"
        )
    return mask


def _refuse_blank(grey: np.ndarray, inside: np.ndarray) -> None:
    values = grey[inside]
    if values.size < 100:
        raise InputError(
            f"only {values.size} pixels of the photograph lie on the specimen: check mm_per_px, origin_px, rotation_deg"
        )
    low, high = np.percentile(values, [1, 99])
    if high - low < 2:
        raise InputError(
            f"the photograph is blank: its grey levels lie between {low:g} and {high:g}; use one with contrast "
            "between stone and mastic, or a label image (labels.png)"
        )


def _thresholds(flat: np.ndarray, inside: np.ndarray, largest_void: float) -> tuple[float, float | None, float]:
    """Threshold of the two main phases, threshold of the voids or None, and the valley between the phases."""
    values, even = flat[inside], flat[even_pixels(flat, inside)]
    threshold = otsu_threshold(values)
    if np.mean(values <= threshold) <= largest_void:  # may be the voids: are there two phases without it?
        upper = otsu_threshold(values[values > threshold])
        depth = valley(even[even > threshold], upper)
        if depth < BIMODAL:
            return upper, void_threshold(even, upper) or threshold, depth
    void_below = void_threshold(even, threshold)
    if void_below is not None and np.mean(values < void_below) > largest_void:
        void_below = None
    solid = values if void_below is None else values[values >= void_below]
    threshold = otsu_threshold(solid)
    depth = valley(even if void_below is None else even[even >= void_below], threshold)
    if depth > BIMODAL:
        raise InputError(
            f"no aggregate can be told from the mastic: the grey levels have one population (valley {depth:.2f} of the "
            f"lower peak, at most {BIMODAL:g} is asked for); use a photograph with more contrast, or a label image "
            "(labels.png)"
        )
    return threshold, void_below, depth


def _solid(raw: np.ndarray, room: np.ndarray, noise_px: float, hole_px: float) -> np.ndarray:
    """Stones without frays and rims thinner than the noise length, their small holes filled, voids kept open."""
    stone: np.ndarray = raw.astype(np.uint8)
    if noise_px >= 1:
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (int(noise_px) | 1,) * 2)
        stone = cv2.morphologyEx(stone, cv2.MORPH_OPEN, kernel)
    return room & ~without_small(stone == 0, hole_px)


def _with_rim(label: np.ndarray, stone: np.ndarray, inside: np.ndarray, placement: ImagePlacement) -> PhaseMap:
    """The phase map with the mask's edge moved out by one pixel: a point at the specimen's edge may lie on it."""
    rim = ~inside & (cv2.dilate(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)
    if rim.any():
        nearest = nearest_inside(inside)[rim]
        label, stone = label.copy(), stone.copy()
        label[rim], stone[rim] = label.ravel()[nearest], stone.ravel()[nearest]
    return PhaseMap(label, stone, placement)


def _refuse_stoneless(count: int, smallest: float) -> None:
    if count == 0:
        raise InputError(
            f"the photograph shows no aggregate of at least {smallest * 1e3:g} mm: check mm_per_px; for a specimen "
            "without stones leave the photograph out (all mastic)"
        )
