"""A notch that is deeper or shallower than was said."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pipeline.core.units import MM
from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class NotchLength(PhysicsEffect):
    """The notch is `value` mm longer than nominal."""

    name = "notch_length_mm"
    says = "the notch is longer than nominal"
    magnitude = Magnitude(-4.0, 4.0, 2.0, "mm")
    remedy = "measure the notch on the broken halves"
    coarseness = 0.577  # its end lies anywhere within a radius: 1/√3
    belongs = "test"

    def change(self, value: float, plan: Plan) -> Plan:
        specimen: Any = plan.specimen
        return replace(plan, specimen=replace(specimen, notch_length=specimen.notch_length + value * MM))
