"""From a bundle to what a diagnosis looks at: stations, points, crack path, noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, InputError, MissingFileError
from pipeline.core.field import DisplacementField
from pipeline.core.specimen import SingleEdgeNotchedBeam, Specimen
from pipeline.core.units import MM
from pipeline.dic.crack import find_crack
from pipeline.gap.observation import Observation, Reading, Sight
from pipeline.gap.response import Abscissae
from pipeline.store.bundle import Bundle
from pipeline.study.assembly import frame_stations
from pipeline.study.observation import nearest_points

HALF, SPACINGS = 3 * MM, 1.5  # half width of the band: so wide, but no less than so many particle spacings
CLEAR = 3 * MM  # points nearer to the crack may lie on the other flank of the model's, and are left out
BEYOND = 1.06  # of the last station: how far simulations go, for gauges that read too little
STANDS_OUT = 6.0  # robust deviations by which neighbours beside the crack part more than others
LEAST_PATH = 5 * MM  # a measured crack shorter than this says nothing of the path


@dataclass(frozen=True, eq=False)
class Seen:
    """What a diagnosis looks at.

    Parameters
    ----------
    observation : Observation
    abscissae : Abscissae
    path : (k, 2) array, m, from the tip on, or None: the fields do not show it
    remarks : tuple of str; what cannot be seen, and what was assumed
    """

    observation: Observation
    abscissae: Abscissae
    path: np.ndarray | None
    remarks: tuple[str, ...]


def seen(bundle: Bundle) -> Seen:
    """What a bundle's measurement shows.

    Raises
    ------
    MissingFileError
        where it has neither a record nor fields
    """
    curve, field = bundle.curve, bundle.fields
    if curve is None and field is None:
        raise MissingFileError(f"{bundle.folder} has neither load_cmod.csv nor fields.h5: nothing can be compared")
    stations, remarks = frame_stations(bundle), []
    if curve is None:
        curve = _ramp(bundle, field)
        remarks.append(
            "no load record: the CMOD is taken from the rate of loading and the times of the fields; what shows in the "
            "load alone (load cell, thickness, modulus with strength) cannot be seen"
        )
    if field is None:
        remarks.append(
            "no displacement fields: only load–CMOD is compared; fixture, camera, lens, drift and clock cannot be "
            "seen, and most physics effects only by class"
        )
    stations = stations[np.isfinite(curve.time_at(stations))]
    path = None if field is None else crack_path(field, bundle.specimen)
    if field is not None and path is None:
        remarks.append("the fields show no crack path: the model's own is taken")
    observation = _observation(bundle, curve, field, stations)
    return Seen(observation, abscissae(stations, curve), path, tuple(remarks))


def _ramp(bundle: Bundle, field: DisplacementField | None) -> LoadCurve:
    assert field is not None
    time = np.linspace(max(field.abscissa[0], 0.0), field.abscissa[-1], 400)
    return LoadCurve(time, bundle.loading.cmod_rate * time, np.full(time.size, np.nan))


def _observation(
    bundle: Bundle, curve: LoadCurve, field: DisplacementField | None, stations: np.ndarray
) -> Observation:
    specimen = bundle.specimen
    points, values, std = _picked(bundle, curve, field, stations)
    peak, load = stations[0] if bundle.curve is None else curve.peak()[0], curve.load_at(stations)
    low, high = (points.min(axis=0), points.max(axis=0)) if field is None else _view(field)
    sight = Sight(
        cmod=stations,
        time=curve.time_at(stations),
        points=points,
        side=sides(points, None),
        tip=np.array(specimen.tip),
        peak_cmod=float(peak),
        centre=(low + high) / 2,
        corner=float(np.hypot(*(high - low)) / 2),
        pull=pull(specimen),
        end_cmod=float(curve.cmod.max()),
        contacts=contacts(specimen),
        load=load,
    )
    load_std = (
        np.full(stations.size, np.nan) if curve.load_std is None else np.interp(stations, curve.cmod, curve.load_std)
    )
    return Observation(sight, Reading(values, load), std, load_std)


def _picked(
    bundle: Bundle, curve: LoadCurve, field: DisplacementField | None, stations: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (p, 2), displacements (s, p, 2) and their standard deviation (s, p) at the stations."""
    wanted = bundle.observation_points
    if field is None:
        shape = stations.size, len(wanted)
        return wanted, np.full((*shape, 2), np.nan), np.full(shape, np.nan)
    chosen = nearest_points(field, wanted)
    part = DisplacementField(
        field.points[chosen],
        field.displacement[:, chosen],
        field.valid[:, chosen],
        field.std[:, chosen],
        field.abscissa,
    ).at(curve.time_at(stations))
    known = part.valid[..., None]
    return part.points, np.where(known, part.displacement, np.nan), np.where(part.valid, part.std, np.nan)


def _view(field: DisplacementField) -> tuple[np.ndarray, np.ndarray]:
    ever = field.points[field.valid.any(axis=0)]
    return ever.min(axis=0), ever.max(axis=0)


def pull(specimen: Specimen) -> np.ndarray:
    """Where the specimen goes when what holds it gives way: with the machine."""
    return np.array([0.0, -1.0]) if specimen.geometry == "seb" else np.array([1.0, 0.0])


def contacts(specimen: Specimen) -> np.ndarray:
    """Where the machine touches; (c, 2), m."""
    spots = specimen.contacts() if isinstance(specimen, SingleEdgeNotchedBeam) else {}
    return np.array(list(spots.values())).reshape(-1, 2)


def crack_path(field: DisplacementField, specimen: Specimen) -> np.ndarray | None:
    """The path (k, 2), m, of the crack in the last frames, from the notch tip on; None where it does not stand out."""
    tip = np.array(specimen.tip)
    for frame in range(len(field.displacement) - 1, max(len(field.displacement) - 6, 0), -1):
        try:
            crack = find_crack(
                field.points, np.nan_to_num(field.displacement[frame]), field.valid[frame], mouth=tip - (0.0, 5 * MM)
            )
        except (InputError, ConvergenceError):
            continue
        ahead = crack.path[crack.path[:, 1] > tip[1] + 0.5 * MM]
        ahead = ahead[np.argsort(ahead[:, 1], kind="stable")]
        if len(ahead) > 2 and np.ptp(ahead[:, 1]) > LEAST_PATH:
            return np.vstack([tip, ahead])
    return coarse_path(field, tip)


def coarse_path(field: DisplacementField, tip: np.ndarray) -> np.ndarray | None:
    """The same on a raster too coarse for that: in each row between the two neighbours that part most.

    Rows count, from the tip on, as long as that step stands out of the row's other steps and of the noise; the path is
    the running median of three rows.
    """
    last = field.displacement[-1]
    rows = []
    for height in np.unique(np.round(field.points[:, 1], 9)):
        row = np.flatnonzero((np.abs(field.points[:, 1] - height) < 1e-9) & field.valid[-1])
        row = row[np.argsort(field.points[row, 0])]
        if height <= tip[1] or row.size < 6:
            continue
        steps = np.diff(last[row, 0])
        widest = int(np.argmax(steps))
        usual = 1.4826 * float(np.median(np.abs(steps - np.median(steps))))
        if steps[widest] < STANDS_OUT * max(usual, float(np.median(field.std[-1, row]))):
            break
        rows.append((field.points[row[widest : widest + 2], 0].mean(), height))
    if len(rows) < 3 or rows[-1][1] - tip[1] < LEAST_PATH:
        return None
    x, y = np.array(rows).T
    ends = np.concatenate([[tip[0]], x, x[-1:]])
    return np.vstack([tip, np.column_stack([np.median([ends[:-2], ends[1:-1], ends[2:]], axis=0), y])])


def sides(points: np.ndarray, path: np.ndarray | None) -> np.ndarray:
    """−1 or +1 (p,): left or right of the crack."""
    centre = 0.0 if path is None else np.interp(points[:, 1], path[:, 1], path[:, 0], left=0.0)
    return np.where(points[:, 0] >= centre, 1.0, -1.0)


def clear_of(points: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Which points (p,) are so far from the path that nothing can have put them on the other flank."""
    along = np.vstack([np.linspace(a, b, 20) for a, b in pairwise(path)])
    distance = np.hypot(*(points[:, None] - along).transpose(2, 0, 1)).min(axis=1)
    return distance > CLEAR


def abscissae(stations: np.ndarray, curve: LoadCurve) -> Abscissae:
    """CMOD values at which simulations are kept: dense about the peak, a little beyond the last station."""
    peak = stations[0] if np.isnan(curve.load).any() else curve.peak()[0]
    return abscissae_about(float(peak), float(stations[-1]))


def abscissae_about(peak: float, last: float) -> Abscissae:
    """The same from the CMOD (m) at the peak and at the last station."""
    end = BEYOND * last
    early = peak * np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.25, 1.6])
    late = np.linspace(2.1 * peak, end, 12)
    load = np.concatenate([np.linspace(peak / 20, 2 * peak, 60), np.linspace(2 * peak, end, 101)[1:]])
    return Abscissae(np.concatenate([early, late]), load)


def own_path(position: np.ndarray, pairs: np.ndarray, share: np.ndarray, tip: np.ndarray) -> np.ndarray:
    """The path (k, 2), m, of a simulated crack: the middle of the bonds, weighted by the softened share (m,).

    Parameters
    ----------
    position, pairs : particles (n, 2), m, and bonds (m, 2)
    share : (m,) array; 0 whole, 1 broken
    tip : (2,) array, m
    """
    middle = position[pairs].mean(axis=1)
    heights = np.arange(tip[1] + 1 * MM, middle[:, 1].max(), 2 * MM)
    rows = []
    for height in heights:
        weight = share * (share > 0.2) * np.exp(-(((middle[:, 1] - height) / (2 * MM)) ** 2))
        if weight.sum() > 0.5:
            rows.append((float(weight @ middle[:, 0] / weight.sum()), float(height)))
    return np.vstack([tip, *rows]) if rows else np.vstack([tip, tip + np.array([0.0, 1 * MM])])


def beside(observation: Observation, path: np.ndarray) -> Observation:
    """The same test with the flanks that a path gives the points, without the points that lie too near to it."""
    points = observation.sight.points
    near = ~clear_of(points, path)
    field = np.where(near[:, None], np.nan, observation.reading.field)
    sight = replace(observation.sight, side=sides(points, path))
    return replace(observation, sight=sight, reading=Reading(field, observation.reading.load))
