"""A specimen that is warmer on one side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.particles import Phase
from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Factors, Place, Plan


@dataclass(frozen=True)
class Slope:
    """Modulus and strength of all but stone rise linearly over the depth, by `rise` from mouth to back."""

    rise: float

    def factors(self, place: Place) -> Factors:
        _, low, _, high = place.specimen.bounds
        factor = 1 + self.rise * (place.middle[:, 1] - (low + high) / 2) / (high - low)
        factor = np.where(place.phase == Phase.AGGREGATE, 1.0, factor)
        return Factors(stiffness=factor, strength=factor)


class ThermalGradient(PhysicsEffect):
    """Modulus and strength change over the depth, antisymmetrically, by `value` from the mouth to the back."""

    name = "thermal_gradient"
    says = "temperature changes over the depth of the specimen"
    magnitude = Magnitude(-0.6, 0.6, 0.3, "1")
    remedy = "log the temperature at mouth and back of a dummy specimen; condition longer"
    belongs = "test"

    def change(self, value: float, plan: Plan) -> Plan:
        return plan.with_bonds(Slope(value))
