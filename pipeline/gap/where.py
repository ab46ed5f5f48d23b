"""Where test and simulation part: by channel, stage, region and mode, against noise and against discrepancy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.units import UM
from pipeline.gap.modes import GROUPS, MODES, REMAINDER, amplitudes, shapes
from pipeline.gap.observation import STAGES, Observation, Sight

REGIONS = ("tip", "flanks", "far field", "supports")
NEAR_TIP, ON_FLANK, NEAR_CONTACT = 7e-3, 15e-3, 12e-3  # m
GROUP_NAMES = (*dict.fromkeys(GROUPS[m] for m in MODES), REMAINDER)


@dataclass(frozen=True)
class Cell:
    """One cell of the table of where.

    Parameters
    ----------
    channel : "field" or "load"
    stage, region, mode : str; region and mode are "all" for the load
    rms : float, µm or N, root mean square of the difference
    unit : "um" or "N"
    z_noise, z_gap : float; rms over what noise alone, and noise with discrepancy, would give
    share : float; of the sum of z_gap² over all cells
    """

    channel: str
    stage: str
    region: str
    mode: str
    rms: float
    unit: str
    z_noise: float
    z_gap: float
    share: float


def regions(sight: Sight) -> np.ndarray:
    """Number of the region in `REGIONS` of every point; (p,) int."""
    arm = np.hypot(*(sight.points - sight.tip).T)
    found = np.digitize(arm, [NEAR_TIP, ON_FLANK])
    if len(sight.contacts):
        gap = np.hypot(*(sight.points[:, None] - sight.contacts).transpose(2, 0, 1)).min(axis=1)
        found[gap < NEAR_CONTACT] = REGIONS.index("supports")
    return found


def where(observation: Observation, residual: np.ndarray, covariance: np.ndarray) -> list[Cell]:
    """The table, the cell that stands out most first.

    Parameters
    ----------
    observation : Observation
    residual : (n,) array; measured − simulated after the refit of the parameters, of the data that are there
    covariance : (n, n) array; noise and discrepancy
    """
    noise = observation.noise[observation.mask]
    rows = []
    for channel, stage, region, mode, operator, count in _operators(observation):
        rms = float(np.sqrt(np.sum((operator @ residual) ** 2) / count))
        by_noise = float(np.sqrt(np.sum(operator**2 @ noise) / count))
        by_both = float(np.sqrt(np.einsum("ab,bc,ac->", operator, covariance, operator, optimize=True) / count))
        rows.append((channel, stage, region, mode, rms, rms / by_noise, rms / by_both))
    total = sum(row[-1] ** 2 for row in rows)
    units = {"field": ("um", UM), "load": ("N", 1.0)}
    cells = [
        Cell(c, s, r, m, rms / units[c][1], units[c][0], zn, zg, zg**2 / total) for c, s, r, m, rms, zn, zg in rows
    ]
    return sorted(cells, key=lambda cell: -cell.z_gap)


def _operators(observation: Observation) -> list[tuple[str, str, str, str, np.ndarray, int]]:
    """Channel, stage, region, mode, operator (j, n) on the data that are there, and points × stations behind it."""
    o = observation
    s, p = o.sight.cmod.size, len(o.sight.points)
    use = o.mask[: 2 * s * p : 2].reshape(s, p)
    take, basis = amplitudes(o.sight, use), shapes(o.sight).reshape(2 * p, len(MODES))
    region_of, stage_of, cut = regions(o.sight), o.sight.stage, 2 * s * p
    found = []
    for stage, region in np.ndindex(len(STAGES), len(REGIONS)):
        stations = np.flatnonzero((stage_of == stage) & (use & (region_of == region)).any(axis=1))
        if not stations.size:
            continue
        count = int((use[stations] & (region_of == region)).sum())
        for group in GROUP_NAMES:
            rows = np.zeros((0, cut + s))
            for station in stations:
                here = np.repeat(use[station] & (region_of == region), 2)
                part = np.zeros((int(here.sum()), cut + s))
                block = slice(2 * p * station, 2 * p * (station + 1))
                part[:, block] = _part(basis, take[station], group, use[station])[here]
                rows = np.vstack([rows, part])
            found.append(("field", STAGES[stage], REGIONS[region], group, rows[:, o.mask], count))
    for stage in range(len(STAGES)):
        loads = cut + np.flatnonzero((stage_of == stage) & o.mask[cut:])
        if loads.size:
            found.append(("load", STAGES[stage], "all", "all", np.eye(cut + s)[loads][:, o.mask], loads.size))
    return found


def _part(basis: np.ndarray, take: np.ndarray, group: str, use: np.ndarray) -> np.ndarray:
    """Operator (2p, 2p) that takes a field to the part of it that a group of modes has."""
    if group == REMAINDER:
        return np.diag(np.repeat(use, 2).astype(float)) - basis @ take
    chosen = [i for i, mode in enumerate(MODES) if GROUPS[mode] == group]
    return basis[:, chosen] @ take[chosen]
