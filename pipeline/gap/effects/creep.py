"""Mastic that creeps."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class Creep(PhysicsEffect):
    """The compliance of the mastic is D(0) + value × (D(t) − D(0)), D(t) that of the bundle's creep test."""

    name = "creep"
    says = "the mastic creeps"
    magnitude = Magnitude(0.0, 2.0, 1.0, "1")
    remedy = "an unload–reload loop, a second loading rate, or a creep test (creep.csv)"

    def change(self, value: float, plan: Plan) -> Plan:
        return replace(plan, creep=value)
