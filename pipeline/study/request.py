"""What a virtual test is asked to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.errors import InputError, UnavailableError
from pipeline.gap.effects import checked, effect

PITCH = 1.9  # of the network, in particle radii: no lattice of the identifying side has it
CAMERA_MM_PER_PX = 0.0439  # Hill et al. 2017, table 1
FIELD_NOISE_PX, PIXEL_NOISE = 0.01, 2.0  # px, grey values of 0 to 255
FRAMES = 61  # under load


@dataclass(frozen=True)
class Request:
    """What a virtual test is asked to be; None is left to chance or to the default.

    Parameters
    ----------
    geometry : "seb" or "dct"
    specimen : image of the specimen, photograph or labels
    mm_per_px : float; scale of `specimen`, its lower edge at the mouth and its middle on the notch line
    like : bundle whose specimen, material and settings are taken over, with the creep test of its mastic
    creep : file with the creep compliance of the mastic, which then creeps; the bundle gets it as its creep test
    f_max, delta_max : the truth, N per bond of the bundle's lattice and m
    start : (N, m) in the bundle's [start]
    radius_mm : of the bundle's lattice
    noise_px, load_noise_n : standard deviations of displacement (of fields, px) and load (N)
    images : speckle images instead of displacement fields
    camera_mm_per_px : float; their scale
    noise_grey : float; standard deviation of one of their pixels, in grey values of 0 to 255
    frames : int; images or fields from the beginning of the loading to the end
    effect : (name, value) pairs; what the model leaves out
    pitch : float; of the network, in particle radii of the bundle's lattice
    poissons_ratio : float; of what is broken, that of the bundle where not given; below its limit bonds carry shear
    """

    geometry: str | None = None
    specimen: Path | None = None
    mm_per_px: float | None = None
    like: Path | None = None
    creep: Path | None = None
    f_max: float | None = None
    delta_max: float | None = None
    start: tuple[float, float] | None = None
    radius_mm: float | None = None
    noise_px: float | None = None
    load_noise_n: float = 5.0
    images: bool = False
    camera_mm_per_px: float | None = None
    noise_grey: float | None = None
    frames: int | None = None
    effect: Sequence[tuple[str, float]] | None = None
    pitch: float = PITCH
    poissons_ratio: float | None = None

    def __post_init__(self) -> None:
        for name, value in self.effect or ():
            checked(name, value)
        if not (np.isfinite(self.pitch) and self.pitch > 0):
            raise InputError(f"pitch = {self.pitch:g} particle radii of the network must be positive")
        if len({name for name, _ in self.effect or ()}) < len(self.effect or ()):
            raise InputError("an effect is given twice: give each once, with its whole value")
        if self.images and self.measuring:
            raise UnavailableError(
                f"{', '.join(self.measuring)} with --images is not in this version: make fields, without --images"
            )
        of_images = {"--camera-mm-per-px": self.camera_mm_per_px, "--noise-grey": self.noise_grey}
        others = {"--noise-px": self.noise_px} if self.images else of_images
        given = [name for name, value in others.items() if value is not None]
        if given:
            what = "displacement fields, not to speckle images" if self.images else "speckle images: add --images"
            raise InputError(f"{' and '.join(given)} belongs to {what}")

    @property
    def effects(self) -> dict[str, float]:
        """All effects by name; a creep test that is given is one, in full unless another share is asked for."""
        return ({"creep": 1.0} if self.creep else {}) | dict(self.effect or ())

    @property
    def measuring(self) -> dict[str, float]:
        """The measurement effects among them."""
        return {n: v for n, v in self.effects.items() if effect(n).kind == "measurement"}

    @property
    def displacement_noise(self) -> float:
        """px, of fields"""
        return FIELD_NOISE_PX if self.noise_px is None else self.noise_px

    @property
    def pixel_noise(self) -> float:
        """grey values, of images"""
        return PIXEL_NOISE if self.noise_grey is None else self.noise_grey

    @property
    def camera_pitch(self) -> float:
        """mm, of images"""
        return self.camera_mm_per_px or CAMERA_MM_PER_PX

    @property
    def frame_count(self) -> int:
        return self.frames or FRAMES
