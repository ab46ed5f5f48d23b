"""A camera and a machine whose clocks differ."""

from __future__ import annotations

import numpy as np

from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.observation import Sight


class SyncOffset(MeasurementEffect):
    """A frame that is given the record's time t was taken at t − offset, at the opening of that moment."""

    name = "sync_offset_s"
    says = "frames are late against the load record"
    magnitude = Magnitude(-4.0, 4.0, 2.0, "s")
    remedy = "show the machine's trigger in the pictures, or film the loading's start at a higher rate"
    belongs = "test"

    def field_at(self, value: np.ndarray, sight: Sight, cmod: np.ndarray) -> np.ndarray:
        return np.interp(sight.time - value[0], *_line(sight.time, cmod))


def _line(time: np.ndarray, cmod: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Time and CMOD, continued to rest before the first station and by one stretch behind the last."""
    first = time[0] - cmod[0] * (time[1] - time[0]) / (cmod[1] - cmod[0])
    rate = (cmod[-1] - cmod[-2]) / (time[-1] - time[-2])
    beyond = time[-1] - time[0]
    return np.concatenate([[first], time, [time[-1] + beyond]]), np.concatenate(
        [[0.0], cmod, [cmod[-1] + rate * beyond]]
    )
