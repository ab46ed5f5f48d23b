"""Strength that rises with the rate of opening."""

from __future__ import annotations

import math
from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class RateLaw(PhysicsEffect):
    """Strength rises by `value` of itself for every decade of opening rate."""

    name = "rate_law_per_decade"
    says = "strength rises with the rate of opening"
    magnitude = Magnitude(0.0, 0.3, 0.15, "1/decade")
    remedy = "a second test at a tenth of the rate"

    def change(self, value: float, plan: Plan) -> Plan:
        return replace(plan, strength_per_decade=value)

    def strength_ratio(self, value: float, faster: float) -> float:
        return max(1 + value * math.log10(faster), 0.0)
