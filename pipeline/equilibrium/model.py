"""What the path is followed on: a network, its law, its gauge, and the way back to all particles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pipeline.core.problem import Problem
from pipeline.equilibrium.constraints import Constraints
from pipeline.equilibrium.network import FiniteNetwork, Network, SmallNetwork, whole_network
from pipeline.materials.cohesive import CentralSoftening, central_law


class Model(Protocol):
    """A specimen in the variables it is solved in; `gauge` (q,) is ∂CMOD/∂q, `gauge_drive` ∂CMOD/∂s."""

    @property
    def network(self) -> Network: ...
    @property
    def law(self) -> CentralSoftening: ...
    @property
    def gauge(self) -> np.ndarray: ...
    @property
    def gauge_drive(self) -> float: ...


@dataclass(frozen=True)
class WholeModel:
    """Every particle and every bond.

    Parameters
    ----------
    law : CentralSoftening
    network : SmallNetwork or FiniteNetwork
    constraints : Constraints
    gauge : (q,) array, ∂CMOD/∂q
    gauge_drive : float, ∂CMOD/∂s
    """

    law: CentralSoftening
    network: SmallNetwork | FiniteNetwork
    constraints: Constraints
    gauge: np.ndarray
    gauge_drive: float

    def displacement(self, free: np.ndarray, machine: float) -> np.ndarray:
        """Displacements (n, 2), m, of all particles."""
        return self.constraints.displacement(free, machine)


def whole_model(problem: Problem) -> WholeModel:
    """The model of a problem without any reduction."""
    network, constraints = whole_network(problem)
    weight = np.zeros(constraints.drive.size)
    np.add.at(weight, constraints.per * problem.gauge.index, problem.gauge.weight)
    drive = float(weight @ constraints.drive)
    return WholeModel(
        central_law(problem.law, "equilibrium"), network, constraints, constraints.expand.T @ weight, drive
    )


@dataclass(frozen=True)
class State:
    """One equilibrium.

    Parameters
    ----------
    free : (q,) array, m; machine : float, m; the variables
    load : float, N; machine load; cmod : float, m
    opening, reached : (m,) arrays, m, of the model's bonds
    energy : float, J; stored and used up
    residual : float, N; largest force out of balance on a free variable
    error : float; estimated relative error of the displacements
    iterations : int
    """

    free: np.ndarray
    machine: float
    load: float
    cmod: float
    opening: np.ndarray
    reached: np.ndarray
    energy: float = 0.0
    residual: float = 0.0
    error: float = 0.0
    iterations: int = 0


def rest(model: Model) -> State:
    """The unloaded specimen."""
    bonds = np.zeros(model.law.k_n.size)
    return State(np.zeros(model.gauge.size), 0.0, 0.0, 0.0, bonds, bonds)


def scaled(state: State, factor: float) -> State:
    """A linear elastic state, scaled."""
    opening = factor * state.opening
    return replace(
        state,
        free=factor * state.free,
        machine=factor * state.machine,
        load=factor * state.load,
        cmod=factor * state.cmod,
        opening=opening,
        reached=np.maximum(opening, 0.0),
        energy=factor**2 * state.energy,
    )
