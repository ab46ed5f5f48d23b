"""Measurement and simulation brought to the same points and CMOD stations."""

from __future__ import annotations

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.field import DisplacementField
from pipeline.core.observation import observe
from pipeline.core.problem import Problem, Solution
from pipeline.core.units import MM
from pipeline.inverse.observations import Measured

PARTED = 0.1  # of delta_max: a bond opened farther no longer joins two flanks


def observe_solution(
    problem: Problem, solution: Solution, points: np.ndarray, flanks_of: Solution | None = None
) -> np.ndarray:
    """Displacements (frames, p, 2) in m of material points in the frames of a solution; NaN where invalid.

    With `flanks_of` over the particles that hang together in that solution, of as many frames: the same material.
    """
    parted = PARTED * np.where(np.isfinite(problem.law.delta_max), problem.law.delta_max, np.inf)
    flanks = None if flanks_of is None else flanks_of.displacement
    values, _ = observe(problem.particles, problem.bonds, solution.displacement, points, parted, None, flanks)
    return values


def at_stations(values: np.ndarray, solution: Solution, stations: np.ndarray) -> np.ndarray:
    """Displacements (s, p, 2) in m at CMOD stations, from those in the frames of a solution (frames, p, 2).

    NaN where a station was not reached.
    """
    found = np.full((stations.size, *values.shape[1:]), np.nan)
    for k, station in enumerate(stations):
        hit = np.flatnonzero(np.isclose(solution.cmod, station, rtol=1e-9, atol=0))
        if hit.size:
            found[k] = values[hit[0]]
    return found


def nearest_points(field: DisplacementField, wanted: np.ndarray) -> np.ndarray:
    """Numbers of the measured points that stand for the wanted ones, each once, in the order of the wanted.

    The simulation is then observed at the measured points themselves, so that nothing is interpolated
    across a crack whose path is unknown.

    Raises
    ------
    InputError
        where no point was ever measured, or a wanted point is farther from every measured one than two
        steps of their grid
    """
    known = field.valid.any(axis=0)
    if known.sum() < 2:
        raise InputError(
            f"{int(known.sum())} of the {known.size} points of the displacement fields are valid in any frame: at "
            "least two are needed; measure again, or compare the load alone with --objective load"
        )
    distance = np.hypot(*(field.points[:, None] - wanted).transpose(2, 0, 1))
    distance[~known] = np.inf
    nearest = np.argmin(distance, axis=0)
    apart = distance[nearest, np.arange(len(wanted))]
    step = _step(field.points[known])
    if apart.max() > 2 * step:
        worst = wanted[np.argmax(apart)] / MM
        raise InputError(
            f"[observation] asks for a point at ({worst[0]:g}, {worst[1]:g}) mm, but the nearest measured point is "
            f"{apart.max() / MM:.3g} mm away: move columns_mm and rows_mm into the measured field"
        )
    return np.array(list(dict.fromkeys(nearest.tolist())))


def _step(points: np.ndarray) -> float:
    """Typical distance (m) of a measured point to its nearest neighbour."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, k=2)
    return float(np.median(distance[:, 1]))


def measured_test(
    curve: LoadCurve, field: DisplacementField | None, stations: np.ndarray, wanted: np.ndarray
) -> Measured:
    """A measured test at its stations, at the measured points nearest to the wanted ones.

    Parameters
    ----------
    curve : LoadCurve with load_std
    field : DisplacementField counted by time, or None
    stations : (s,) array, m
    wanted : (p, 2) array, m
    """
    picked = None
    if field is not None:
        chosen = nearest_points(field, wanted)
        series = DisplacementField(
            field.points[chosen],
            field.displacement[:, chosen],
            field.valid[:, chosen],
            field.std[:, chosen],
            field.abscissa,
        )
        picked = series.at(curve.time_at(stations))
    load = curve.load_at(stations)
    std = None if curve.load_std is None else np.interp(stations, curve.cmod, curve.load_std)
    return Measured(stations, picked, load, std)
