"""An effect: one nameable thing the model leaves out, how large it may be, and how it acts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy.special import ndtr

from pipeline.core.errors import InputError
from pipeline.gap.observation import Reading, Sight
from pipeline.gap.plan import Plan

Belongs = Literal["material", "set-up", "test"]


@dataclass(frozen=True)
class Magnitude:
    """How large an effect may plausibly be: a normal distribution about none, cut off at the bounds.

    Parameters
    ----------
    low, high : float; bounds, low ≤ 0 < high
    scale : float, positive; standard deviation before the cut
    unit : str; of the value, "1" for a ratio
    directions : int; 2 where the effect has an unknown direction in the plane: its value is then the length
    """

    low: float
    high: float
    scale: float
    unit: str
    directions: int = 1

    def __post_init__(self) -> None:
        if not (self.low <= 0 < self.high and self.scale > 0):
            raise InputError(f"a magnitude from {self.low:g} to {self.high:g} must hold 0, its scale be positive")

    @property
    def bounds(self) -> tuple[float, float]:
        """Of one component: either way where the direction is unknown."""
        return (-self.high, self.high) if self.directions > 1 else (self.low, self.high)

    def log_density(self, value: np.ndarray | float) -> np.ndarray:
        """Logarithm of the prior density of one component; −inf outside the bounds."""
        low, high = self.bounds
        mass = ndtr(high / self.scale) - ndtr(low / self.scale)
        z = np.asarray(value, float) / self.scale
        inside = (np.asarray(value) >= low) & (np.asarray(value) <= high)
        return np.where(inside, -0.5 * z**2 - np.log(self.scale * np.sqrt(2 * np.pi) * mass), -np.inf)

    @property
    def trials(self) -> tuple[float, float]:
        """Two values at which a physics effect is simulated: either way, or a smaller and a larger one."""
        if self.low < 0:
            return 0.6 * self.low, 0.6 * self.high
        return 0.35 * self.high, 0.75 * self.high


class Effect(ABC):
    """What every effect says of itself.

    name : as in --effect NAME=VALUE; the value is the deviation from the model, 0 is none
    says : one sentence for people, without a full stop
    magnitude : Magnitude
    equivalents : what else, not in the library, does exactly the same
    remedy : what to measure to find out, or to do without it
    coarseness : standard deviation of the value that particles of 1 mm radius leave open: nothing is placed in a
        lattice better than by a particle
    belongs : to what: the material (as large in every test of it), the set-up (as large in every test made alike), or
        this one test
    """

    name: ClassVar[str]
    says: ClassVar[str]
    magnitude: ClassVar[Magnitude]
    equivalents: ClassVar[tuple[str, ...]] = ()
    remedy: ClassVar[str]
    coarseness: ClassVar[float] = 0.0
    belongs: ClassVar[Belongs]
    kind: ClassVar[str]


class MeasurementEffect(Effect):
    """Acts on what is read off a simulation; costs none."""

    kind = "measurement"
    belongs: ClassVar[Belongs] = "set-up"

    def field_at(self, value: np.ndarray, sight: Sight, cmod: np.ndarray) -> np.ndarray:
        """True CMOD (s,), m, at which the fields of the stations were taken, when without it they were at `cmod`."""
        return cmod

    def load_at(self, value: np.ndarray, sight: Sight, cmod: np.ndarray) -> np.ndarray:
        """True CMOD (s,), m, at which the loads of the stations were taken."""
        return cmod

    def distort(self, value: np.ndarray, sight: Sight, reading: Reading) -> Reading:
        """What is read instead."""
        return reading


class PhysicsEffect(Effect):
    """Acts on the plan of a test, before it is built and simulated."""

    kind = "physics"
    belongs: ClassVar[Belongs] = "material"

    @abstractmethod
    def change(self, value: float, plan: Plan) -> Plan:
        """The plan with the effect in it."""

    def strength_ratio(self, value: float, faster: float) -> float:
        """Factor on f_max in a test whose mouth opens so many times as fast."""
        return 1.0
