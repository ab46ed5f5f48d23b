"""A clip gauge that reads too much."""

from __future__ import annotations

import numpy as np

from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.observation import Sight


class CmodGain(MeasurementEffect):
    """The gauge reads (1 + gain) times the true opening, so the stations lie at smaller openings than they say."""

    name = "cmod_gain"
    says = "the clip gauge reads too much"
    magnitude = Magnitude(-0.15, 0.15, 0.075, "1")
    remedy = "check the clip gauge on a micrometer; compare it with the opening in the images"

    def field_at(self, value: np.ndarray, sight: Sight, cmod: np.ndarray) -> np.ndarray:
        return cmod / (1 + value[0])

    def load_at(self, value: np.ndarray, sight: Sight, cmod: np.ndarray) -> np.ndarray:
        return cmod / (1 + value[0])
