"""The incremental potential: its gradient, and a secant stiffness to measure steps by."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.equilibrium.factor import Solve
from pipeline.equilibrium.network import Network
from pipeline.materials.memory import Memory
from pipeline.materials.trial import Trial

SOFTENING_SHARE = 0.2  # of the secant stiffness of softening bonds; 1 needs a fifth more iterations, 0.03 no fewer
FLOOR = 1e-6  # of the elastic stiffness: left to broken bonds, whose loose particles would make the factors singular


@dataclass(frozen=True)
class Potential:
    """Π(q; s) with the history frozen: what one increment minimises.

    Parameters
    ----------
    network : Network
    memory : Memory of the same bonds before the increment
    duration : float, s; how long the increment takes in the test
    """

    network: Network
    memory: Memory
    duration: float = 0.0
    trial: Trial = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "trial", self.memory.trial(self.duration))

    def gradient(self, free: np.ndarray, machine: float) -> np.ndarray:
        """∂Π/∂q (q,), N."""
        return self.state(free, machine)[0]

    def state(self, free: np.ndarray, machine: float) -> tuple[np.ndarray, float, np.ndarray]:
        """∂Π/∂q (q,), N; ∂Π/∂s, the machine's load, N; deformation (k,), m, of the bonds."""
        deformation = self.network.opening(free, machine)
        return *self.network.pull(self.trial.force(deformation), free, machine), deformation

    def settled(self, deformation: np.ndarray) -> Memory:
        """The bonds after the increment, which ended at the deformation (k,), m."""
        return self.memory.settled(deformation, self.duration)

    def energy(self, free: np.ndarray, machine: float, memory: Memory) -> float:
        """Stored and used-up energy, J, with the bonds as they are in that state."""
        return float(memory.stored.sum() + memory.used.sum()) + self.network.energy(free, machine)

    def measure(self, free: np.ndarray, machine: float) -> Solve:
        """Steps by a stiffness that stands for the Hessian: positive definite.

        Force over opening for every bond, but a share of it for bonds on their softening branch: their
        tangent is negative. All of it would majorise the potential, and is stiffer than needed.
        """
        deformation = self.network.opening(free, machine)
        weight = self.trial.secant(deformation)
        weight = np.where(self.trial.softening(deformation), SOFTENING_SHARE * weight, weight)
        return self.network.measure(np.maximum(weight, FLOOR * self.trial.elastic), free, machine)


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
