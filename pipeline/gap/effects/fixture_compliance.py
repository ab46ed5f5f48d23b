"""Supports or pins that give way."""

from __future__ import annotations

import numpy as np

from pipeline.core.units import KN, UM
from pipeline.gap.effect import Magnitude, MeasurementEffect
from pipeline.gap.observation import Reading, Sight


class FixtureCompliance(MeasurementEffect):
    """The specimen moves as a whole by compliance × load, along the pull on its supports.

    By the measured load where there is one: what the simulated load is off would otherwise show in the fields.
    """

    name = "fixture_compliance_um_per_kn"
    says = "supports or pins give way under load"
    magnitude = Magnitude(0.0, 60.0, 30.0, "µm/kN")
    remedy = "measure points near the supports, or the fixture under a stiff dummy"

    def distort(self, value: np.ndarray, sight: Sight, reading: Reading) -> Reading:
        measured = sight.load if sight.load.size else np.full(reading.load.shape, np.nan)
        load = np.where(np.isfinite(measured), measured, reading.load)
        moved = value[0] * UM / KN * load[:, None] * sight.pull
        return Reading(reading.field + moved[:, None, :], reading.load)
