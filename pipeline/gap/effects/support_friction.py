"""Supports or pins that rub."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class SupportFriction(PhysicsEffect):
    """Coulomb friction at supports that slide outwards, or at pins that turn, in full slip from the start."""

    name = "support_friction"
    says = "supports or pins rub"
    magnitude = Magnitude(0.0, 0.5, 0.25, "1")
    remedy = "use rollers or needle bearings; an unload–reload loop shows twice the friction"
    belongs = "set-up"

    def change(self, value: float, plan: Plan) -> Plan:
        return replace(plan, friction=value)
