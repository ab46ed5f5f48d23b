"""A notch tip that was hurt by sawing."""

from __future__ import annotations

from dataclasses import replace

from pipeline.core.units import MM
from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class TipDamage(PhysicsEffect):
    """Bonds within 3 mm of the tip have spent `value` of their softening branch: (κ − δ_peak)/(δ_max − δ_peak)."""

    name = "tip_damage"
    says = "the material at the notch tip is damaged before the test"
    magnitude = Magnitude(0.0, 0.95, 0.475, "1")
    remedy = "look at the tip under a microscope or in CT; polish or pre-crack it"
    belongs = "test"

    def change(self, value: float, plan: Plan) -> Plan:
        return replace(plan, spent=value, spent_radius=3 * MM)
