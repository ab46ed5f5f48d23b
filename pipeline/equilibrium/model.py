"""What the path is followed on: a network, its law, its gauge, and the way back to all particles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.core.problem import BondLaw, Problem
from pipeline.equilibrium.constraints import Constraints
from pipeline.equilibrium.network import FiniteNetwork, Network, SmallNetwork, whole_network
from pipeline.materials.memory import Memory, at_rest


class Model(Protocol):
    """A specimen in the variables it is solved in; `gauge` (q,) is ∂CMOD/∂q, `gauge_drive` ∂CMOD/∂s."""

    @property
    def network(self) -> Network: ...
    @property
    def law(self) -> BondLaw: ...
    @property
    def gauge(self) -> np.ndarray: ...
    @property
    def gauge_drive(self) -> float: ...


@dataclass(frozen=True)
class WholeModel:
    """Every particle and every bond.

    Parameters
    ----------
    law : BondLaw
    network : SmallNetwork or FiniteNetwork
    constraints : Constraints
    gauge : (q,) array, ∂CMOD/∂q
    gauge_drive : float, ∂CMOD/∂s
    """

    law: BondLaw
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
    return WholeModel(problem.law, network, constraints, constraints.expand.T @ weight, drive)


@dataclass(frozen=True)
class State:
    """One equilibrium.

    Parameters
    ----------
    free : (q,) array, m; machine : float, m; the variables
    load : float, N; machine load; cmod : float, m
    memory : Memory; the model's bonds
    time : float, s; how long the test has taken so far, 0 where nothing asks
    energy : float, J; stored and used up
    residual : float, N; largest force out of balance on a free variable
    error : float; estimated relative error of the displacements
    iterations : int
    """

    free: np.ndarray
    machine: float
    load: float
    cmod: float
    memory: Memory
    time: float = 0.0
    energy: float = 0.0
    residual: float = 0.0
    error: float = 0.0
    iterations: int = 0


@dataclass(frozen=True)
class ElasticResponse:
    """What an undamaged specimen does per metre of machine displacement.

    Parameters
    ----------
    free : (q,) array; variables
    load : float, N/m; cmod : float
    deformation : (k,) array; of the model's bonds
    """

    free: np.ndarray
    load: float
    cmod: float
    deformation: np.ndarray

    @property
    def energy(self) -> float:
        """J/m²."""
        return self.load / 2


def rest(model: Model) -> State:
    """The unloaded specimen."""
    return State(np.zeros(model.gauge.size), 0.0, 0.0, 0.0, at_rest(model.law))


def moved_at_once(model: Model, response: ElasticResponse, machine: float) -> State:
    """The specimen after a machine displacement, m, that damages nothing and takes no time."""
    return State(
        free=machine * response.free,
        machine=machine,
        load=machine * response.load,
        cmod=machine * response.cmod,
        memory=at_rest(model.law).settled(machine * response.deformation, 0.0),
        energy=machine**2 * response.energy,
    )
