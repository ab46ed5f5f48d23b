"""Stone that is stronger or weaker than was said."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class AggregateStrength(PhysicsEffect):
    """The strength of stone is (1 + value) times the bundle's."""

    name = "aggregate_strength"
    says = "the stone is stronger than was said"
    magnitude = Magnitude(-0.6, 0.6, 0.3, "1")
    remedy = "count broken stones on the crack faces; test the stone by itself"

    def change(self, value: float, plan: Plan) -> Plan:
        ratio = (1 + value) * plan.mixture.aggregate_strength_ratio
        return replace(plan, mixture=replace(plan.mixture, aggregate_strength_ratio=ratio))
