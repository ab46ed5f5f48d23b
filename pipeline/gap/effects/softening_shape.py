"""A softening branch that is not straight."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan
from pipeline.materials.softening import Shape, Softening


class SofteningShape(PhysicsEffect):
    """Between one straight line (0) and two lines with a long tail (1; Petersson 1981), the area kept."""

    name = "softening_shape"
    says = "softening has a steep beginning and a long tail"
    magnitude = Magnitude(0.0, 1.0, 0.5, "1")
    remedy = "test farther into the tail, or measure tensile strength on its own"

    def change(self, value: float, plan: Plan) -> Plan:
        return replace(plan, mixture=replace(plan.mixture, softening=Softening(Shape.BILINEAR_TAIL, value)))
