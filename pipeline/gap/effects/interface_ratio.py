"""Bond between stone and mastic that is stronger or weaker than was said."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class InterfaceRatio(PhysicsEffect):
    """The strength of interfaces over that of mastic is (1 + value) times the bundle's."""

    name = "interface_ratio"
    says = "interfaces are stronger than was said"
    magnitude = Magnitude(-0.5, 0.5, 0.25, "1")
    remedy = "look for bare stone on the crack faces; pull-off test of mastic on stone"

    def change(self, value: float, plan: Plan) -> Plan:
        ratio = (1 + value) * plan.mixture.interface_strength_ratio
        return replace(plan, mixture=replace(plan.mixture, interface_strength_ratio=ratio))
