"""Voids that no image shows."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class AirVoids(PhysicsEffect):
    """A share of the mastic's area is missing, in voids too small for the picture."""

    name = "air_voids"
    says = "there are air voids that the image does not show"
    magnitude = Magnitude(0.0, 0.12, 0.06, "1")
    remedy = "measure the air voids by weighing under water, or by CT"

    def change(self, value: float, plan: Plan) -> Plan:
        return replace(plan, void_share=value)
