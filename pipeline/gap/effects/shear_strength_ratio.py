"""Bonds that are stronger or weaker in shear than was said."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class ShearStrengthRatio(PhysicsEffect):
    """Tangential over normal strength is (1 + value) times the bundle's."""

    name = "shear_strength_ratio"
    says = "bonds are stronger in shear than was said"
    magnitude = Magnitude(-0.6, 0.6, 0.3, "1")
    remedy = "a mixed-mode test of the same mixture"

    def change(self, value: float, plan: Plan) -> Plan:
        ratio = (1 + value) * plan.mixture.shear_strength_ratio
        return replace(plan, mixture=replace(plan.mixture, shear_strength_ratio=ratio))
