"""A lens that stretches its rim."""

from __future__ import annotations

import numpy as np

from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.observation import Reading, Sight


class LensDistortion(MeasurementEffect):
    """A point at x from the centre is seen at x (1 + value |x|²/corner²) (Brown 1971, first radial term).

    Displacements are differences of seen positions. That the undeformed position is seen wrong too changes them by
    value × displacement gradient × distance only, below a thousandth of the displacement, and is left out.
    """

    name = "lens_distortion"
    says = "the lens distorts radially"
    magnitude = Magnitude(-0.02, 0.02, 0.01, "1")
    remedy = "photograph a calibration plate with the same lens and distance"

    def distort(self, value: np.ndarray, sight: Sight, reading: Reading) -> Reading:
        before = sight.points - sight.centre
        after = before + reading.field
        moved = after * np.sum(after**2, axis=-1, keepdims=True) - before * np.sum(before**2, axis=-1, keepdims=True)
        return Reading(reading.field + value[0] / sight.corner**2 * moved, reading.load)
