"""A load cell that reads too much."""

from __future__ import annotations

import numpy as np

from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.observation import Reading, Sight


class LoadGain(MeasurementEffect):
    """The load cell reads (1 + gain) times the true load."""

    name = "load_gain"
    says = "the load cell reads too much"
    magnitude = Magnitude(-0.15, 0.15, 0.075, "1")
    equivalents = ("thickness", "all moduli and strengths together")
    remedy = "check the load cell with a dead weight and the thickness with a caliper"

    def distort(self, value: np.ndarray, sight: Sight, reading: Reading) -> Reading:
        return Reading(reading.field, (1 + value[0]) * reading.load)
