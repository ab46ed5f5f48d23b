"""Static condensation: what stays elastic becomes a stiffness between the variables around the crack.

Bonds are *active*, followed through the law, or *far*, elastic with K^n. Variables that move an active bond
or the gauge are kept; the others are eliminated exactly (Schur complement; Guyan 1965). After every
increment the far bonds are looked at: one that would have been damaged becomes active.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from pipeline.equilibrium.model import State, WholeModel
from pipeline.equilibrium.network import SmallNetwork
from pipeline.equilibrium.potential import factorise
from pipeline.materials.cohesive import LinearSoftening


@dataclass(frozen=True)
class CondensedNetwork:
    """Active bonds on an elastic support.

    Parameters
    ----------
    bonds : SmallNetwork of the active bonds in the kept variables
    edge : (b,) int array; kept variables that the support acts on
    support : (b + 1, b + 1) array, N/m, over these and the machine displacement
    spread : (q, q) sparse array, N/m; the same over all kept variables, without the machine
    """

    bonds: SmallNetwork
    edge: np.ndarray
    support: np.ndarray
    spread: sparse.csc_array

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        return self.bonds.opening(free, machine)

    def pull(self, force: np.ndarray, free: np.ndarray, machine: float) -> tuple[np.ndarray, float]:
        internal, load = self.bonds.pull(force, free, machine)
        carried = self.support @ np.append(free[self.edge], machine)
        internal[self.edge] += carried[:-1]
        return internal, load + float(carried[-1])

    def stiffness(self, weight: np.ndarray, free: np.ndarray, machine: float) -> sparse.csc_array:
        return (self.bonds.stiffness(weight, free, machine) + self.spread).tocsc()

    def energy(self, free: np.ndarray, machine: float) -> float:
        moved = np.append(free[self.edge], machine)
        return 0.5 * float(moved @ self.support @ moved)


@dataclass(frozen=True)
class FarField:
    """The eliminated variables: K_ff q_f + K_fk q_k + K_fs s = 0.

    Parameters
    ----------
    inner : (f,) int array; eliminated variables, numbered in the whole model
    factor : SuperLU of K_ff
    coupling : (f, k) sparse array K_fk, and drive (f,) array K_fs, N/m
    """

    inner: np.ndarray
    factor: SuperLU
    coupling: sparse.csr_array
    drive: np.ndarray

    def follow(self, kept: np.ndarray, machine: float) -> np.ndarray:
        """Eliminated variables (f,), m."""
        return -self.factor.solve(self.coupling @ kept + machine * self.drive)


@dataclass(frozen=True)
class CondensedModel:
    """A whole model reduced to the variables of its active bonds.

    Parameters
    ----------
    whole : WholeModel
    active : (m,) bool array over all bonds
    kept : (q,) int array; kept variables, numbered in the whole model
    network : CondensedNetwork; law, gauge and gauge_drive : as in `model.Model`
    far : FarField
    """

    whole: WholeModel
    active: np.ndarray
    kept: np.ndarray
    network: CondensedNetwork
    law: LinearSoftening
    gauge: np.ndarray
    gauge_drive: float
    far: FarField

    def complete(self, free: np.ndarray, machine: float) -> np.ndarray:
        """Variables of the whole model (all,), m."""
        every = np.zeros(self.whole.gauge.size)
        every[self.kept] = free
        every[self.far.inner] = self.far.follow(free, machine)
        return every

    def reduce(self, state: State) -> State:
        """A state of the whole model in the variables of this one."""
        return replace(
            state, free=state.free[self.kept], opening=state.opening[self.active], reached=state.reached[self.active]
        )

    def expand(self, state: State) -> State:
        """A state of this model in the variables of the whole one; far bonds never opened farther than now."""
        free = self.complete(state.free, state.machine)
        opening = self.whole.network.opening(free, state.machine)
        reached = np.maximum(opening, 0.0)
        reached[self.active] = state.reached
        return replace(state, free=free, opening=opening, reached=reached)

    def weak(self, state: State, share: float) -> np.ndarray:
        """Far bonds (m,) bool that a state of this model opens beyond `share` of their δ_peak."""
        opening = self.whole.network.opening(self.complete(state.free, state.machine), state.machine)
        return ~self.active & (opening > share * self.whole.law.delta_peak)


def condense(whole: WholeModel, active: np.ndarray) -> CondensedModel:
    """Reduce a model with small kinematics to the variables of its active bonds (m,) bool."""
    network, law = whole.network, whole.law
    if not isinstance(network, SmallNetwork) or not isinstance(law, LinearSoftening):
        raise TypeError("only linear kinematics and a law that can be divided are condensed")
    kept, inner = _divide(network, active, whole.gauge)
    rigid = network.part(~active, np.arange(whole.gauge.size))
    stiffness = rigid.stiffness(law.k_n[~active], whole.gauge, 0.0).tocsr()
    pull, load = rigid.pull(law.k_n[~active] * rigid.drive, whole.gauge, 0.0)
    inside = stiffness[inner][:, inner].tocsc()
    far = FarField(inner, factorise(inside), stiffness[inner][:, kept].tocsr(), pull[inner])
    edge = np.flatnonzero(np.diff(stiffness[kept].indptr))
    held = kept[edge]
    outer = sparse.block_array([[stiffness[held][:, held], pull[held, None]], [pull[None, held], [[load]]]]).tocsc()
    across = sparse.hstack([far.coupling[:, edge], far.drive[:, None]]).tocsc()
    support = schur_complement(inside, across, outer, far.factor)
    return CondensedModel(
        whole=whole,
        active=active,
        kept=kept,
        network=CondensedNetwork(network.part(active, kept), edge, support, _spread(support, edge, kept.size)),
        law=law.of(active),
        gauge=whole.gauge[kept],
        gauge_drive=whole.gauge_drive,
        far=far,
    )


def _divide(network: SmallNetwork, active: np.ndarray, gauge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variables to keep and to eliminate: those that move an active bond or the gauge, and the others."""
    needed = gauge != 0
    needed[network.jacobian[active].indices] = True
    return np.flatnonzero(needed), np.flatnonzero(~needed)


def schur_complement(
    inside: sparse.csc_array, across: sparse.csc_array, outer: sparse.csc_array, factor: SuperLU
) -> np.ndarray:
    """D − Bᵀ A⁻¹ B (b, b) of symmetric [[A, B], [Bᵀ, D]], with A factorised.

    It is the last block of the factors of the whole matrix with D ordered last, at the price of one
    factorisation instead of b solutions. D is made heavier before and lighter after: the whole may be singular.
    """
    order, start = np.argsort(factor.perm_c), inside.shape[0]
    ballast = 2 * np.abs(outer.diagonal()) + np.abs(outer.diagonal()).mean()
    matrix = sparse.block_array(
        [[inside[order][:, order], across[order]], [across[order].T, outer + sparse.diags_array(ballast)]]
    ).tocsc()
    whole = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    last = whole.perm_c[start:]
    if last.min() < start:  # the elimination tree has several roots and was ordered otherwise
        schur = outer.toarray() - across.T @ factor.solve(across.toarray())
        return 0.5 * (schur + schur.T)
    schur = (whole.L.tocsr()[last][:, start:] @ whole.U.tocsr()[start:][:, last]).toarray()
    schur[np.diag_indices_from(schur)] -= ballast
    return 0.5 * (schur + schur.T)


def _spread(support: np.ndarray, edge: np.ndarray, size: int) -> sparse.csc_array:
    """The support among the kept variables as a sparse array (size, size)."""
    row, column = np.repeat(edge, edge.size), np.tile(edge, edge.size)
    return sparse.coo_array((support[:-1, :-1].ravel(), (row, column)), shape=(size, size)).tocsc()
