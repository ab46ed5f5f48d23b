"""How the data of one test are weighed: noise, discrepancy, other places of the lattice, scatter of simulations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.gap.emulator import Emulator
from pipeline.gap.fit import Data, Fitted
from pipeline.gap.learning import local_factor
from pipeline.gap.library import Entry
from pipeline.gap.metric import Metric
from pipeline.gap.observation import Observation
from pipeline.inverse.surrogate import LagrangeSurrogate, node_covariance


def weighed(observation: Observation, emulator: Emulator, entry: Entry) -> tuple[Observation, Data]:
    """The data that all simulations have, with Σ = noise + discrepancy + scatter of the simulations themselves."""
    part = observation.only(observation.mask & emulator.available())
    mask = part.mask
    some = np.ix_(mask, mask)
    modes = entry.discrepancy.of_modes(part.sight, part.load_scale)[some]
    modes += entry.discrepancy.placements * elsewhere(emulator, mask)
    local = np.diag(part.noise)
    cut = part.reading.field.size
    local[:cut, :cut] += entry.discrepancy.local(part.sight)
    local[some] += apparent(emulator, mask, entry.apparent)
    metric = Metric(modes + local[some] + scatter(emulator, mask), modes, entry.discrepancy.tail)
    return part, Data(part.reading.flat()[mask], metric, emulator.box)


def elsewhere(emulator: Emulator, mask: np.ndarray) -> np.ndarray:
    """Covariance (n, n) of the mean of the lattice's places: which bonds a stone holds is an accident."""
    changes = emulator.elsewhere(mask)
    return changes.T @ changes / max(len(changes) * (len(changes) - 1), 1)


def apparent(emulator: Emulator, mask: np.ndarray, scatter: Mapping[str, float]) -> np.ndarray:
    """Covariance (n, n) of effects that specimens seem to have though there are none.

    How many bonds of which kind a crack meets is as random as if interfaces were stronger in one specimen than in the
    next: `scatter` holds the standard deviations by the names of physics effects.
    """
    columns = [scatter[name] * slope for name, slope in emulator.slopes(mask).items() if scatter.get(name, 0.0) > 0]
    rows = np.reshape(columns, (len(columns), int(mask.sum())))
    return rows.T @ rows


def fitted_to(entry: Entry, observation: Observation, emulator: Emulator, best: Fitted) -> Entry:
    """The entry with local scatter as large as this very test shows it beside its best explanation."""
    part = observation.only(observation.mask & emulator.available())
    reading = emulator.reading(best.parameters, best.candidate.names, best.amplitudes)
    factor = local_factor(replace(part, reading=part.reading - reading), entry.discrepancy)
    return replace(entry, discrepancy=entry.discrepancy.scaled(1.0, factor))


def scatter(emulator: Emulator, mask: np.ndarray) -> np.ndarray:
    """Covariance (n, n) of what changes from simulation to simulation without order (crack paths that jump).

    From node to node of the grid what no smooth function of the parameters has; and what nudges of the parameters
    change beside the point that all effects are simulated at.
    """
    nodes = [np.array([f, d]) for f in emulator.f_max for d in emulator.delta_max]
    seen = np.reshape(
        [emulator.reading(node).flat()[mask] for node in nodes],
        (emulator.f_max.size, emulator.delta_max.size, -1),
    )
    nodes_differ = node_covariance(LagrangeSurrogate(emulator.f_max, emulator.delta_max, seen))[0]
    jitter = emulator.jitter(mask)
    return nodes_differ + jitter.T @ jitter / max(len(jitter), 1)
