"""A camera or a specimen that creeps away."""

from __future__ import annotations

import numpy as np

from pipeline.core.units import MINUTE, UM
from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.observation import Reading, Sight


class Drift(MeasurementEffect):
    """The specimen moves as a whole at a constant speed in an unknown direction, from the beginning of the record."""

    name = "drift_um_per_min"
    says = "specimen and camera drift against each other"
    magnitude = Magnitude(0.0, 30.0, 15.0, "µm/min", directions=2)
    remedy = "film the specimen unloaded for as long as a test, or a fixed mark beside it"
    belongs = "test"

    def distort(self, value: np.ndarray, sight: Sight, reading: Reading) -> Reading:
        direction = np.append(value, 0.0)[:2]  # one component: along x
        moved = sight.time[:, None] * direction * UM / MINUTE
        return Reading(reading.field + moved[:, None, :], reading.load)
