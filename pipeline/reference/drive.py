"""How fast the machine goes: every few steps the lag is measured and the speed follows it.

The same rule as fix cohesive/drive of the LAMMPS engine, whose constants these are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

HASTE = 10.0  # how much faster the rate falls than it rises
ERROR_PER_EXCESS = 2.25  # error of the load over the rms excess: the most of ten specimens, against equilibria
JUMP = 3.0  # a crack jumps where the mouth opens by so much more than the machine's way has opened it so far


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
    excess : float, N; by how much that puts the load off, over the CMOD of the test
    excess_squares, load_squares : float, N² m; ∫ excess² dCMOD, ∫ P² dCMOD
    opened : float, m; largest CMOD of a record
    cmod : float, m; at the last record
    """

    rate: float
    peak: float
    spent: float
    lag: float = 0.0
    excess: float = 0.0
    excess_squares: float = 0.0
    load_squares: float = 0.0
    opened: float = 0.0
    cmod: float = 0.0

    @property
    def error(self) -> float:
        """Error of the load over the test so far, from the root mean squares of the excess and of the load."""
        return ERROR_PER_EXCESS * float(np.sqrt(self.excess_squares / self.load_squares)) if self.load_squares else 0.0

    def allowed(self, wanted: float) -> float:
        """What the lag should be now: the share `wanted` is of the root mean square of the load over CMOD.

        That of a load in proportion before there is one. Where more was spent already less is left, down to a half.
        """
        if not self.load_squares:
            return wanted / float(np.sqrt(3))
        mean = float(np.sqrt(self.load_squares / self.opened)) / self.peak
        spent = float(np.sqrt(self.excess_squares / self.load_squares)) / wanted
        return wanted * min(mean, 1.0) / float(np.clip(spent, 1, 2))

    def measure(self, energy: Energies, cmod: float, load: float, line: float, steps: int, share: float) -> Drive:
        """The lag over the last `steps`, `share` of a period: it rises at once and fades over a period.

        lag = Δ(E_kin + E_damp) / (P_peak × way), way = rate × steps, and the excess Δ(E_kin + E_damp) / way, in which
        the way counts as no shorter than so much opening took so far: where the crack jumps the machine (at `line`, m)
        stands still, and that counts there only. Where the mouth swings back nothing is added.
        """
        peak, spent = max(self.peak, load), energy.kinetic + energy.damping
        now, way, keep = abs(spent - self.spent), self.rate * steps, 1 - min(1.0, share)
        opened = max(cmod - self.opened, 0.0)
        excess = counted = self.excess * keep
        if opened > 0 and cmod > 0:
            usual = opened * line / cmod
            counted = now / max(way, usual)
            if usual <= JUMP * way:
                counted = excess = max(counted, excess)
        return replace(
            self,
            peak=peak,
            spent=spent,
            lag=max(now / (peak * way), self.lag * keep),
            excess=excess,
            excess_squares=self.excess_squares + counted**2 * opened,
            load_squares=self.load_squares + load**2 * opened,
            opened=self.opened + opened,
            cmod=cmod,
        )

    def factor(self, wanted: float, share: float, lowest: float, highest: float) -> float:
        """By how much to change the rate: by the root of wanted over measured lag, down ten times as fast as up."""
        wish = np.sqrt(wanted / max(self.lag, 1e-3 * wanted))
        change = np.clip(wish ** (share * (HASTE if wish < 1 else 1.0)), 0.5, 1 + share)
        return float(np.clip(change, lowest / self.rate, highest / self.rate))
