"""A specimen that comes nearer to the camera."""

from __future__ import annotations

import numpy as np

from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.observation import Reading, Sight


class Magnification(MeasurementEffect):
    """Positions grow about the centre of the view, in proportion to the CMOD, by `value` at the end of the test."""

    name = "magnification"
    says = "the picture grows during the test (out-of-plane motion)"
    magnitude = Magnitude(-0.003, 0.003, 0.0015, "1")
    remedy = "film an unloaded plate beside the specimen, or use a second camera or a telecentric lens"
    belongs = "test"

    def distort(self, value: np.ndarray, sight: Sight, reading: Reading) -> Reading:
        share = value[0] * sight.cmod / sight.end_cmod
        seen = reading.field + share[:, None, None] * (sight.points - sight.centre + reading.field)
        return Reading(seen, reading.load)
