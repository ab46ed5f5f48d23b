"""The incremental potential: its gradient, and the secant stiffness that majorises it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from pipeline.core.errors import InputError
from pipeline.core.problem import CohesiveLaw
from pipeline.equilibrium.network import Network

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
    law: CohesiveLaw
    reached: np.ndarray

    def gradient(self, free: np.ndarray, machine: float) -> np.ndarray:
        """∂Π/∂q (q,), N."""
        return self.state(free, machine)[0]

    def state(self, free: np.ndarray, machine: float) -> tuple[np.ndarray, float, np.ndarray]:
        """∂Π/∂q (q,), N; ∂Π/∂s, the machine's load, N; openings (m,), m."""
        opening = self.network.opening(free, machine)
        force = self.law.force(opening, self.reached)
        return *self.network.pull(force, free, machine), opening

    def energy(self, opening: np.ndarray) -> float:
        """Stored and used-up energy, J, at openings (m,), m."""
        reached = np.maximum(opening, self.reached)
        return float(self.law.stored(opening, reached).sum() + self.law.dissipated(reached).sum())

    def secant(self, free: np.ndarray, machine: float) -> sparse.csc_array:
        """Secant stiffness (q, q), N/m, force over opening of every bond: positive definite."""
        opening = self.network.opening(free, machine)
        tension = opening > 0
        at = np.where(tension, opening, 1.0)
        weight = np.where(tension, self.law.force(at, self.reached) / at, self.law.k_n)
        return self.network.stiffness(np.maximum(weight, FLOOR * self.law.k_n), free, machine)


def factorise(stiffness: sparse.csc_array) -> SuperLU:
    """Symmetric factorisation without pivoting.

    Raises
    ------
    InputError
        if the stiffness is singular: grips that leave a rigid motion, or particles without bonds
    """
    options = {"SymmetricMode": True}
    try:
        factor = splu(stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError as problem:
        raise InputError(_SINGULAR) from problem
    pivots = np.abs(factor.U.diagonal())
    if not pivots.min() > 1e-13 * pivots.max():
        raise InputError(_SINGULAR)
    return factor


_SINGULAR = (
    "the elastic stiffness of the specimen is singular: the grips must stop every rigid motion and every "
    "particle needs at least two bonds that are not in line"
)


@dataclass
class SecantPreconditioner:
    """The factorised secant stiffness, renewed where the minimiser asks for it; counts its factorisations."""

    potential: Potential
    machine: float
    factor: SuperLU | None = None
    renewals: int = field(default=0)

    def renew(self, at: np.ndarray) -> None:
        self.factor = factorise(self.potential.secant(at, self.machine))
        self.renewals += 1

    def solve(self, gradient: np.ndarray) -> np.ndarray:
        assert self.factor is not None, "renew() comes first"
        return self.factor.solve(gradient)
