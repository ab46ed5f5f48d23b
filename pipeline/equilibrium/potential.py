"""The incremental potential: its gradient, and a secant stiffness to measure steps by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.equilibrium.factor import Solve
from pipeline.equilibrium.network import Network
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.softening import Unloading

SOFTENING_SHARE = 0.2  # of the secant stiffness of softening bonds; 1 needs a fifth more iterations, 0.03 no fewer
FLOOR = 1e-6  # of K^n: left to broken bonds in the preconditioner, which loose particles would make singular


@dataclass(frozen=True)
class Potential:
    """Π(q; s) with the history frozen: what one increment minimises.

    Parameters
    ----------
    network : Network
    law : CohesiveLaw of the same bonds
    reached : (m,) array, m; largest opening before the increment
    """

    network: Network
    law: CentralSoftening
    reached: np.ndarray

    def gradient(self, free: np.ndarray, machine: float) -> np.ndarray:
        """∂Π/∂q (q,), N."""
        return self.state(free, machine)[0]

    def state(self, free: np.ndarray, machine: float) -> tuple[np.ndarray, float, np.ndarray]:
        """∂Π/∂q (q,), N; ∂Π/∂s, the machine's load, N; openings (m,), m."""
        opening = self.network.opening(free, machine)
        force = self.law.force(opening, self.reached)
        return *self.network.pull(force, free, machine), opening

    def energy(self, free: np.ndarray, machine: float, opening: np.ndarray) -> float:
        """Stored and used-up energy, J, with the openings (m,), m, of that state."""
        reached = np.maximum(opening, self.reached)
        bonds = float(self.law.stored(opening, reached).sum() + self.law.dissipated(reached).sum())
        return bonds + self.network.energy(free, machine)

    def measure(self, free: np.ndarray, machine: float) -> Solve:
        """Steps by a stiffness that stands for the Hessian: positive definite.

        Force over opening for every bond, but a share of it for bonds on their softening branch: their
        tangent is negative. All of it would majorise the potential, and is stiffer than needed.
        """
        opening = self.network.opening(free, machine)
        at = np.where(opening > 0, opening, 1.0)
        force = self.law.force(at, self.reached)
        weight = np.where(opening > 0, force / at, self.law.k_n)
        if self.law.unloading is Unloading.ELASTIC:
            weight = np.where((opening > 0) & (opening < self.reached) & (force > 0), self.law.k_n, weight)
        softening = (opening > self.law.delta_peak) & (opening >= self.reached)
        weight = np.where(softening, SOFTENING_SHARE * weight, weight)
        return self.network.measure(np.maximum(weight, FLOOR * self.law.k_n), free, machine)


@dataclass
class SecantPreconditioner:
    """The factorised secant stiffness, renewed where the minimiser asks for it."""

    potential: Potential | None = None
    machine: float = 0.0
    factor: Solve | None = None

    def move(self, potential: Potential, machine: float) -> None:
        """Serve another potential, with the old factorisation until it is renewed."""
        self.potential, self.machine = potential, machine

    def renew(self, at: np.ndarray) -> None:
        """Factorise the secant stiffness at this state (q,)."""
        assert self.potential is not None, "move() comes first"
        self.factor = self.potential.measure(at, self.machine)

    def solve(self, gradient: np.ndarray) -> np.ndarray:
        """The step (q,), m, that the factorised stiffness gives under forces (q,), N."""
        assert self.factor is not None, "renew() comes first"
        return self.factor(gradient)
