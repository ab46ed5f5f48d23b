"""A mixture whose mastic creeps: from phases to the arms and the law of every bond."""

from __future__ import annotations

import numpy as np

from pipeline.core.particles import Bonds, Phase
from pipeline.materials.burgers import Burgers
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.elastic import central_force_stiffness
from pipeline.materials.mixture import Mixture
from pipeline.materials.prony import PronySeries
from pipeline.materials.relaxation import Arms

ARMS = 2  # of a Burgers model


def creeping_arms(mixture: Mixture, mastic: Burgers, phase: np.ndarray, thickness: float) -> Arms:
    """K(t) of hexagonal-lattice bonds: mastic creeps, stone does not, the interface has the mean of both compliances.

    At t = 0 these are the stiffnesses of an elastic mixture of mastic modulus 1/D₁. Poisson's ratio is constant.

    Parameters
    ----------
    mixture : Mixture; its mastic_modulus is not used
    mastic : Burgers
    phase : (m,) array of bond phases
    thickness : float, m
    """
    per_modulus = central_force_stiffness(1.0, mixture.poissons_ratio, mixture.plane, thickness)
    none = np.zeros(ARMS), np.ones(ARMS), mixture.aggregate_modulus
    table = {
        Phase.MASTIC: _row(mastic.relaxation()),
        Phase.INTERFACE: _row(mastic.averaged_with_elastic(mixture.aggregate_modulus).relaxation()),
        Phase.AGGREGATE: none,
        Phase.TOUCHING: none,
    }
    rows = np.array([list(table).index(Phase(int(p))) for p in np.unique(phase)])
    place = np.searchsorted(np.unique(phase), phase)
    modulus, time, left = (np.array([row[k] for row in table.values()])[rows][place] for k in range(3))
    return Arms(per_modulus * modulus, time, per_modulus * left)


def creeping_law(
    mixture: Mixture, mastic: Burgers, bonds: Bonds, thickness: float, f_max: float, delta_max: float
) -> CreepingSoftening:
    """The law of every bond of a hexagonal lattice whose mastic creeps; protected bonds take no damage.

    Parameters as of `Mixture.law` and `creeping_arms`.
    """
    force, opening = mixture.strength(bonds.phase, f_max, delta_max)
    free = ~bonds.protected
    rise = creeping_arms(mixture, mastic, bonds.phase, thickness)
    return CreepingSoftening(
        rise, np.where(free, force, np.inf), np.where(free, opening, np.inf), mixture.softening, mixture.unloading
    )


def _row(series: PronySeries) -> tuple[np.ndarray, np.ndarray, float]:
    return series.modulus, series.time, series.infinity
