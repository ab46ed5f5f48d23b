"""Mastic that is stiffer or softer than was said."""

from __future__ import annotations

from dataclasses import replace

from pipeline.gap.effect import Magnitude, PhysicsEffect
from pipeline.gap.plan import Plan


class Modulus(PhysicsEffect):
    """The modulus of the mastic is (1 + value) times the bundle's."""

    name = "modulus"
    says = "the modulus of the mastic is off (temperature)"
    magnitude = Magnitude(-0.5, 0.5, 0.25, "1")
    remedy = "measure the modulus at the temperature of the test, or log the temperature in a dummy specimen"

    def change(self, value: float, plan: Plan) -> Plan:
        mixture = replace(plan.mixture, mastic_modulus=(1 + value) * plan.mixture.mastic_modulus)
        return replace(plan, mixture=mixture)
