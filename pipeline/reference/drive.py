"""How fast the machine goes: every few steps the lag is measured and the speed follows it.

The same rule as fix cohesive/drive of the LAMMPS engine, whose constants these are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

HASTE = 10.0  # how much faster the rate falls than it rises
ERROR_PER_LAG = 2.0  # the load is off by up to about twice the lag (measured against the equilibrium engine)


@dataclass(frozen=True)
class Energies:
    """Sums since the start of the run, and what is there now, J."""

    external: float
    stored: float
    dissipated: float
    kinetic: float
    damping: float


@dataclass(frozen=True)
class Drive:
    """The machine between two records.

    Parameters
    ----------
    rate : float, m per step
    peak : float, N; largest load so far, the load at first damage before that is exceeded
    spent : float, J; kinetic energy and damping at the last record
    lag : float; share of the machine's power, at peak load, that goes into motion and drag
    lag_squares : float, m; ∫ lag² dCMOD
    cmod : float, m; at the last record
    """

    rate: float
    peak: float
    spent: float
    lag: float = 0.0
    lag_squares: float = 0.0
    cmod: float = 0.0

    @property
    def error(self) -> float:
        """Error of the load over the test so far: twice the root mean square of the lag over CMOD."""
        return ERROR_PER_LAG * float(np.sqrt(max(self.lag_squares, 0.0) / self.cmod)) if self.cmod > 0 else 0.0

    def measure(self, energy: Energies, cmod: float, load: float, steps: int, share: float) -> Drive:
        """The lag over the last `steps`, `share` of a period: it rises at once and fades over a period.

        lag = Δ(E_kin + E_damp) / (P_peak × rate × steps)
        """
        peak, spent = max(self.peak, load), energy.kinetic + energy.damping
        now = abs(spent - self.spent) / (peak * self.rate * steps)
        lag = max(now, self.lag * (1 - min(1.0, share)))
        squares = self.lag_squares + lag**2 * (cmod - self.cmod)
        return replace(self, peak=peak, spent=spent, lag=lag, lag_squares=squares, cmod=cmod)

    def factor(self, wanted: float, share: float, lowest: float, highest: float) -> float:
        """By how much to change the rate: by the root of wanted over measured lag, down ten times as fast as up."""
        wish = np.sqrt(wanted / max(self.lag, 1e-3 * wanted))
        change = np.clip(wish ** (share * (HASTE if wish < 1 else 1.0)), 0.5, 1 + share)
        return float(np.clip(change, lowest / self.rate, highest / self.rate))
