"""Static condensation: what stays elastic becomes a stiffness between the variables around the crack.

Bonds are *active*, followed through the law, or *far*, elastic with K^n and K^s. Variables that move a bond of the
strip or the gauge are kept; the others are eliminated exactly (Schur complement; Guyan 1965). After every increment
the far bonds are looked at: one that would have been damaged becomes active, as an island or in a wider strip.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.linalg.blas import dsymv

from pipeline.core.problem import BondLaw
from pipeline.equilibrium.assembly import Assembly, assembly
from pipeline.equilibrium.cholesky import Plan, available
from pipeline.equilibrium.dissection import dissected
from pipeline.equilibrium.factor import Solve, factorise_elastic, rough_dense_solve, rough_solve, singular
from pipeline.equilibrium.far import FarField, solve_far
from pipeline.equilibrium.islands import Islands, joined, no_islands
from pipeline.equilibrium.model import ElasticResponse, State, WholeModel
from pipeline.equilibrium.network import SmallNetwork
from pipeline.equilibrium.schur import schur_complement
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.memory import CentralMemory, MixedMemory, at_rest
from pipeline.materials.mixed_softening import MixedSoftening

ROUND_OFF = 1e-9  # of K^n: below, a bond counts as elastic in the stiffness that steps are measured by


@dataclass(frozen=True)
class CondensedNetwork:
    """Active bonds on an elastic support; the variables are those kept, then one for each island.

    Parameters
    ----------
    bonds : SmallNetwork of the strip's bonds in the kept variables
    edge : (b,) int array; kept variables that the support acts on
    support : (b + 1, b + 1) array, N/m, over these and the machine displacement
    islands : Islands
    assembly : Assembly of the strip's bonds and the support
    plan : Plan of their factorisation; None where the compiled library is missing
    order : (k,) int array; where each deformation stands when those of the strip come before those of the islands
    """

    bonds: SmallNetwork
    edge: np.ndarray
    support: np.ndarray
    islands: Islands
    assembly: Assembly
    plan: Plan | None
    order: np.ndarray

    @property
    def kept(self) -> int:
        return self.bonds.jacobian.shape[1]

    def opening(self, free: np.ndarray, machine: float) -> np.ndarray:
        apart = self.islands.opening(self._moved(free, machine), free[self.kept :])
        return np.append(self.bonds.opening(free[: self.kept], machine), apart)[self.order]

    def pull(self, force: np.ndarray, free: np.ndarray, machine: float) -> tuple[np.ndarray, float]:
        force = self._parted(force)
        strip, moved = self.bonds.drive.size, self._moved(free, machine)
        internal, load = self.bonds.pull(force[:strip], free[: self.kept], machine)
        carried, own = self.islands.pull(force[strip:], moved, free[self.kept :])
        carried += dsymv(1.0, self.support.T, moved)
        internal[self.edge] += carried[:-1]
        return np.append(internal, own), load + float(carried[-1])

    def stiffness(self, weight: np.ndarray, free: np.ndarray, machine: float) -> sparse.csc_array:
        """Without the coupling of strip and islands, which is weak: still positive definite."""
        inner, apart = self._blocks(weight)
        return sparse.block_diag([inner, sparse.csc_array(apart)], format="csc") if apart.size else inner

    def measure(self, weight: np.ndarray, free: np.ndarray, machine: float) -> Solve:
        inner, apart = self._blocks(weight)
        strip = self.plan.factor(inner, single=True).solve if self.plan else rough_solve(inner, ordered=True)
        if not apart.size:
            return strip
        islands = rough_dense_solve(apart)
        return lambda right: np.append(strip(right[: self.kept]), islands(right[self.kept :]))

    def exact(self, weight: np.ndarray) -> Solve:
        """Displacements (q,), m, under forces (q,), N, without islands; refuses what can move without resistance."""
        inner, _ = self._blocks(weight)
        if self.plan is None:
            return factorise_elastic(inner).solve
        factor = self.plan.factor(inner, single=False)
        if factor.raised:
            raise singular()
        return factor.solve

    def _blocks(self, weight: np.ndarray) -> tuple[sparse.csc_array, np.ndarray]:
        """Stiffnesses of the strip and of the islands, N/m, for bonds of `weight` (m,), N/m."""
        weight, strip, islands = self._parted(weight), self.bonds.drive.size, self.islands
        lost = np.maximum(islands.k_n - weight[strip:], 0.0)
        changed = lost > ROUND_OFF * islands.k_n
        row = np.sqrt(lost[changed, None]) * islands.row[changed, :-1]
        inner = self.assembly.stiffness(weight[:strip], self.support[:-1, :-1] - row.T @ row)
        return inner, islands.inverse - np.diag(lost)

    def energy(self, free: np.ndarray, machine: float) -> float:
        moved = self._moved(free, machine)
        return 0.5 * float(moved @ self.support @ moved) + self.islands.energy(moved, free[self.kept :])

    def _parted(self, values: np.ndarray) -> np.ndarray:
        """Values (k,) of all deformations, those of the strip before those of the islands."""
        parted = np.empty_like(values)
        parted[self.order] = values
        return parted

    def _moved(self, free: np.ndarray, machine: float) -> np.ndarray:
        """Edge and machine (b + 1,), m."""
        return np.append(free[self.edge], machine)


@dataclass(frozen=True)
class CondensedModel:
    """A whole model reduced to the variables of its active bonds.

    Parameters
    ----------
    whole : WholeModel
    strip : (m,) bool array over all bonds; those followed in the kept variables
    kept : (q,) int array; kept variables, numbered in the whole model
    network : CondensedNetwork; law, gauge and gauge_drive : as in `model.Model`
    far : FarField
    """

    whole: WholeModel
    strip: np.ndarray
    kept: np.ndarray
    network: CondensedNetwork
    law: CentralSoftening | MixedSoftening
    gauge: np.ndarray
    gauge_drive: float
    far: FarField

    @property
    def bonds(self) -> np.ndarray:
        """Numbers of the active bonds in the whole model, in the order of this one."""
        return np.append(np.flatnonzero(self.strip), self._apart)

    @property
    def _apart(self) -> np.ndarray:
        """Numbers of the bonds that are islands."""
        index = self.network.islands.index
        return index[index < self.strip.size]

    @property
    def active(self) -> np.ndarray:
        """Which bonds (m,) bool are followed through the law."""
        chosen = self.strip.copy()
        chosen[self._apart] = True
        return chosen

    def complete(self, free: np.ndarray, machine: float) -> np.ndarray:
        """Variables of the whole model (all,), m."""
        kept, extra = free[: self.kept.size], free[self.kept.size :]
        every = np.zeros(self.whole.gauge.size)
        every[self.kept] = kept
        every[self.far.inner] = self.far.follow(kept, machine, self.network.islands, extra)
        return every

    def elastic(self) -> ElasticResponse:
        """How the undamaged whole answers a motion of the machine."""
        network, stiffness = self.network, at_rest(self.law).trial(0.0).elastic
        still = np.zeros(self.gauge.size)
        pull, _ = network.pull(stiffness * network.opening(still, 1.0), still, 1.0)
        own = -network.exact(stiffness)(pull)
        _, load = network.pull(stiffness * network.opening(own, 1.0), own, 1.0)
        free = self.complete(own, 1.0)
        cmod = float(self.gauge @ own) + self.gauge_drive
        return ElasticResponse(free, load, cmod, self.whole.network.opening(free, 1.0))

    def reduce(self, state: State) -> State:
        """A state of the whole model in the variables of this one."""
        kept, islands, memory = state.free[self.kept], self.network.islands, _divisible_memory(state)
        moved = np.append(kept[self.network.edge], state.machine)
        extra = memory.deformation[islands.index] - islands.opening(moved, np.zeros(islands.count))
        return replace(state, free=np.append(kept, extra), memory=memory.of(self.bonds))

    def expand(self, state: State) -> State:
        """A state of this model in the variables of the whole one; far bonds never opened farther than now."""
        free = self.complete(state.free, state.machine)
        deformation = self.whole.network.opening(free, state.machine)
        return replace(state, free=free, memory=_among(state, self.whole.law, self.bonds, deformation))

    def carry(self, state: State, grown: CondensedModel) -> State:
        """A state of this model in the variables of one grown from it; its new bonds are elastic until now."""
        before, after = self.network.islands, grown.network.islands
        lost = before.tension_lost(state.free[self.kept.size :])
        extra = after.compliance[before.count :, : before.count] @ lost
        free = np.append(state.free, extra)
        deformation = grown.network.opening(free, state.machine)
        return replace(state, free=free, memory=_among(state, grown.law, np.arange(self.bonds.size), deformation))

    def usage(self, state: State) -> np.ndarray:
        """Share (m,) of its strength that every far bond has used in a state of this model; 0 for active bonds."""
        deformation = self.whole.network.opening(self.complete(state.free, state.machine), state.machine)
        return np.where(self.active, 0.0, at_rest(self.whole.law).trial(0.0).usage(deformation))

    def grown(self, more: np.ndarray) -> CondensedModel:
        """The model with further bonds (m,) bool as islands, by one solution of the far field each."""
        index = np.flatnonzero(more & ~self.active)
        if not index.size:
            return self
        (whole, law), far, edge = _divisible(self.whole), self.far, self.network.edge
        rows, elastic = _deformations(self.whole, index), at_rest(law).trial(0.0).elastic
        jacobian = whole.jacobian[rows].tocsr()
        inner = jacobian[:, far.inner].tocsr()
        columns = far.columns(inner.T.tocsc())
        across = sparse.hstack([far.coupling[:, edge], far.drive[:, None]]).tocsr()
        direct = np.column_stack([jacobian[:, self.kept[edge]].toarray(), whole.drive[rows]])
        row = direct - (across.T @ columns).T
        islands = joined(self.network.islands, rows, row, columns, inner, elastic[rows])
        gauge = np.append(self.whole.gauge[self.kept], np.zeros(islands.count))
        bonds = np.append(self.bonds, index)
        first = _deformations(self.whole, np.flatnonzero(self.strip))
        order = _places(np.append(first, islands.index), _deformations(self.whole, bonds))
        network = replace(self.network, islands=islands, order=order)
        return replace(self, network=network, law=law.of(bonds), gauge=gauge)


def condense(whole: WholeModel, active: np.ndarray) -> CondensedModel:
    """Reduce a model with small kinematics to the variables of its active bonds (m,) bool, the strip."""
    network, law = _divisible(whole)
    followed, rest = (_deformations(whole, np.flatnonzero(chosen)) for chosen in (active, ~active))
    kept, inner = _divide(network, followed, whole.gauge)
    rigid, elastic = network.part(rest, np.arange(whole.gauge.size)), at_rest(law).trial(0.0).elastic[rest]
    stiffness = rigid.stiffness(elastic, whole.gauge, 0.0).tocsr()
    pull, load = rigid.pull(elastic * rigid.drive, whole.gauge, 0.0)
    kept = kept[_order(network, followed, kept, stiffness)]
    inner = inner[dissected(stiffness[inner][:, inner], network.place[inner])]
    inside = stiffness[inner][:, inner].tocsc()
    solve = solve_far(inside)
    far = FarField(inner, solve, stiffness[inner][:, kept].tocsr(), pull[inner])
    edge = np.flatnonzero(np.diff(stiffness[kept].indptr))
    held = kept[edge]
    outer = sparse.block_array([[stiffness[held][:, held], pull[held, None]], [pull[None, held], [[load]]]]).tocsc()
    across = sparse.hstack([far.coupling[:, edge], far.drive[:, None]]).tocsc()
    support = schur_complement(inside, across, outer, solve)
    bonds = network.part(followed, kept)
    islands = no_islands(edge.size, inner.size)
    frame = assembly(bonds.jacobian, edge)
    plan = Plan(frame.stiffness(np.ones(bonds.drive.size), support[:-1, :-1])) if available() else None
    return CondensedModel(
        whole=whole,
        strip=active,
        kept=kept,
        network=CondensedNetwork(bonds, edge, support, islands, frame, plan, np.arange(followed.size)),
        law=law.of(active),
        gauge=whole.gauge[kept],
        gauge_drive=whole.gauge_drive,
        far=far,
    )


def _divisible(whole: WholeModel) -> tuple[SmallNetwork, CentralSoftening | MixedSoftening]:
    """Network and law of a model that can be condensed."""
    network, law = whole.network, whole.law
    if not isinstance(network, SmallNetwork) or not isinstance(law, CentralSoftening | MixedSoftening):
        raise TypeError("only linear kinematics and a law that can be divided are condensed")
    return network, law


def _divisible_memory(state: State) -> CentralMemory | MixedMemory:
    """The bonds of a model that can be condensed."""
    if not isinstance(state.memory, CentralMemory | MixedMemory):
        raise TypeError("only bonds that do not creep are condensed")
    return state.memory


def _among(state: State, law: BondLaw, bonds: np.ndarray, deformation: np.ndarray) -> CentralMemory | MixedMemory:
    """The bonds of a state, (k,) int among more of them with `law`, the others undamaged."""
    memory = _divisible_memory(state)
    if isinstance(memory, CentralMemory) and isinstance(law, CentralSoftening):
        return memory.among(law, bonds, deformation)
    assert isinstance(memory, MixedMemory), "a model has one law"
    assert isinstance(law, MixedSoftening), "a model has one law"
    return memory.among(law, bonds, deformation)


def _deformations(whole: WholeModel, bonds: np.ndarray) -> np.ndarray:
    """Numbers of the deformations of bonds (k,) int: all openings, then all slidings if there are any."""
    network, _ = _divisible(whole)
    every = whole.law.k_n.size
    return np.concatenate([bonds + start for start in range(0, network.drive.size, every)])


def _places(given: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Where each of the wanted numbers stands among those given, all different."""
    sorting = np.argsort(given)
    return sorting[np.searchsorted(given[sorting], wanted)]


def _divide(network: SmallNetwork, followed: np.ndarray, gauge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variables to keep and to eliminate: those that move a deformation that is followed or the gauge, and the others.

    `followed` (k,) int.
    """
    needed = gauge != 0
    needed[network.jacobian[followed].indices] = True
    return np.flatnonzero(needed), np.flatnonzero(~needed)


def _order(network: SmallNetwork, followed: np.ndarray, kept: np.ndarray, far: sparse.csr_array) -> np.ndarray:
    """A good order of elimination (q,) of the kept variables, those on the edge being all coupled.

    `far` (all, all) is the stiffness of the other bonds.
    """
    edge = np.flatnonzero(np.diff(far[kept].indptr))
    strip = network.part(followed, kept)
    return dissected(abs(strip.transpose) @ abs(strip.jacobian), strip.place, last=edge)
