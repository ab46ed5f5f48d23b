"""Physical time as a function of the opening of the mouth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError


@dataclass(frozen=True)
class Clock:
    """When the gauge of the *test* read what: t(CMOD), straight between the points and beyond the last.

    Simulations drive much faster than tests do. What creeps asks this clock, with the CMOD of the simulation, how much
    time went by in the test; time does not run backwards where the CMOD does.

    Parameters
    ----------
    cmod : (k,) array, m, increasing from 0, at least two
    time : (k,) array, s, increasing from 0
    """

    cmod: np.ndarray
    time: np.ndarray

    def __post_init__(self) -> None:
        for name in ("cmod", "time"):
            values = np.array(getattr(self, name), float)
            object.__setattr__(self, name, values)
            if values.ndim != 1 or values.size < 2 or values[0] != 0 or not np.all(np.diff(values) > 0):
                raise InputError(f"{name} of a clock must be two or more values that increase from 0")
        if self.cmod.size != self.time.size or not np.isfinite(self.cmod[-1] + self.time[-1]):
            raise InputError(f"a clock needs one finite time for each of its {self.cmod.size} openings")

    def at(self, cmod: float) -> float:
        """Time (s) at a CMOD (m); 0 for a closing mouth."""
        if cmod <= 0:
            return 0.0
        k = min(int(np.searchsorted(self.cmod, cmod, side="left")), self.cmod.size - 1)
        rate = (self.time[k] - self.time[k - 1]) / (self.cmod[k] - self.cmod[k - 1])
        return float(self.time[k - 1] + rate * (cmod - self.cmod[k - 1]))


def steady(cmod_rate: float) -> Clock:
    """The clock of a test whose mouth opens at `cmod_rate` (m/s) throughout."""
    if not (np.isfinite(cmod_rate) and cmod_rate > 0):
        raise InputError(f"cmod_rate = {cmod_rate:g} m/s must be positive")
    return Clock(np.array([0.0, cmod_rate]), np.array([0.0, 1.0]))
