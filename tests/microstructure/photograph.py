"""Drawn photographs of cut faces whose phases are known."""

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.microstructure.gradation import fuller_section


@dataclass(frozen=True)
class Photograph:
    """A drawn photograph and its truth."""

    image: np.ndarray
    stone: np.ndarray
    void: np.ndarray
    metres_per_px: float


def draw(seed, aggregate=70, mastic=150, noise=5.0, light=0.3, voids=0, pitch=1e-4, size=(0.08, 0.04)):
    """A graded section with stones of varied tone, round voids in the mastic, blur, light from one corner and noise."""
    rng = np.random.default_rng(seed)
    section = fuller_section(*size, pitch, rng)
    tone = rng.normal(0, 6, section.diameter.size + 1) * (np.arange(section.diameter.size + 1) > 0)
    void = np.zeros(section.stone.shape, np.uint8)
    while voids:
        spot = np.zeros_like(void)
        cv2.circle(spot, tuple(int(rng.integers(n)) for n in void.shape[::-1]), int(rng.integers(6, 15)), 1, -1)
        if not (section.stone[spot > 0]).any():
            void, voids = void | spot, voids - 1
    image = np.where(section.stone > 0, aggregate, mastic) + tone[section.stone]
    image = cv2.GaussianBlur(np.where(void > 0, 10.0, image), (0, 0), 0.8)
    y, x = np.mgrid[-1 : 1 : image.shape[0] * 1j, -1 : 1 : image.shape[1] * 1j]
    image = image * (1 + light * (0.6 * x + 0.4 * y - 0.3 * (x * x + y * y))) + rng.normal(0, noise, image.shape)
    return Photograph(np.clip(image, 0, 255).astype(np.uint8), section.stone, void > 0, pitch)
