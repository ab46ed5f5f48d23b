"""A load beside the notch line."""

from __future__ import annotations

from dataclasses import replace

from pipeline.core.units import MM
from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class Eccentricity(PhysicsEffect):
    """The load acts `value` mm to the right of the notch line."""

    name = "eccentricity_mm"
    says = "the load acts beside the notch line"
    magnitude = Magnitude(-8.0, 8.0, 4.0, "mm")
    remedy = "measure where the platen touches; film both supports"
    belongs = "test"

    def change(self, value: float, plan: Plan) -> Plan:
        return replace(plan, eccentricity=value * MM)
