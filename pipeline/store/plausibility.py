"""Rules that show wrong units, wrong scales and clocks that do not belong together."""

from __future__ import annotations

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.field import rigid_residual
from pipeline.core.specimen import SingleEdgeNotchedBeam, Specimen
from pipeline.core.units import MINUTE, MM, MPA
from pipeline.store.sections import PixelFrame

CMOD_RANGE = (2e-4, 0.25)  # largest CMOD against notch + ligament
STRESS_RANGE = (0.05 * MPA, 100 * MPA)  # nominal bending stress at the peak, Pa
RATE_RANGE = (1 / 20, 20)  # mean CMOD rate of the record against [loading]; 60 is a mistaken minute
MOTION_RANGE = (1 / 300, 30)  # relative motion in the field against the CMOD of the same time
COVER = 0.005  # share of the specimen that an image shows, and of the image that shows specimen


def curve_problems(curve: LoadCurve, specimen: Specimen, cmod_rate: float | None) -> list[str]:
    """Sentences where CMOD, load or time of a record cannot have the units of load_cmod.csv.

    Rules: the largest CMOD lies between 2e-4 and 1/4 of notch + ligament; the nominal bending stress at the
    peak between 0.05 and 100 MPa; the mean CMOD rate within a factor 20 of `cmod_rate` (m/s).
    """
    problems = []
    size = specimen.notch_length + specimen.ligament_length
    largest = float(curve.cmod.max())
    low, high = CMOD_RANGE
    if not low <= largest / size <= high:
        unit = "metres" if largest / size < low else "micrometres"
        problems.append(
            f"load_cmod.csv: cmod_mm reaches {largest / MM:.4g}, outside {low * size / MM:.3g} to "
            f"{high * size / MM:.3g} mm for this specimen: are these {unit}? The column is in mm"
        )
    peak = float(curve.load.max())
    stress = peak * nominal_stress(specimen)
    low, high = STRESS_RANGE
    if not low <= stress <= high:
        unit = "kN" if stress < low else "mN"
        problems.append(
            f"load_cmod.csv: load_n peaks at {peak:.4g}, a nominal stress of {stress / MPA:.3g} MPa, outside "
            f"{low / MPA:g} to {high / MPA:g} MPa: is this {unit}? The column is in N"
        )
    return problems + _rate_problems(curve, cmod_rate)


def _rate_problems(curve: LoadCurve, cmod_rate: float | None) -> list[str]:
    measured = (curve.cmod[-1] - curve.cmod[0]) / (curve.time[-1] - curve.time[0])
    low, high = RATE_RANGE
    if cmod_rate is None or low <= measured / cmod_rate <= high:
        return []
    shown = [rate / MM * MINUTE for rate in (measured, cmod_rate)]
    return [
        f"load_cmod.csv: CMOD grows by {shown[0]:.3g} mm/min on the average, [loading] cmod_rate_mm_per_min says "
        f"{shown[1]:.3g}: is time_s in minutes or milliseconds, or the rate wrong?"
    ]


def nominal_stress(specimen: Specimen) -> float:
    """Bending stress in the ligament (Pa) per newton of load, the notch's sharpness left aside.

    Beam: 1.5 P S/(t b²); compact tension: P/(t b) + 6 P (a + b/2)/(t b²), b the ligament.
    """
    b, t = specimen.ligament_length, specimen.thickness
    if isinstance(specimen, SingleEdgeNotchedBeam):
        return 1.5 * specimen.span / (t * b**2)
    return 1 / (t * b) + 6 * (specimen.notch_length + b / 2) / (t * b**2)


def clock_problems(file: str, time: np.ndarray, curve: LoadCurve) -> list[str]:
    """A sentence where fewer than two frames (time, s) fall into the record."""
    inside = (time >= curve.time[0]) & (time <= curve.time[-1])
    if inside.sum() >= min(2, time.size):
        return []
    return [
        f"{file}: its times, {time[0]:g} to {time[-1]:g} s, do not overlap those of load_cmod.csv, "
        f"{curve.time[0]:g} to {curve.time[-1]:g} s: bring both to one clock, or give [dic] sync_offset_s"
    ]


def place_problems(file: str, points: np.ndarray, specimen: Specimen) -> list[str]:
    """A sentence where points (n, 2), m, are all but one, or fewer than half of them lie on the specimen."""
    x0, y0, x1, y1 = specimen.bounds
    spread = float(np.ptp(points, axis=0).max())
    if len(points) > 1 and spread < 1e-3 * max(x1 - x0, y1 - y0):
        return [f"{file}: points lie within {spread / MM:.3g} mm of each other: are these metres? points are in mm"]
    margin = 0.05 * max(x1 - x0, y1 - y0)
    low, high = np.array([x0, y0]) - margin, np.array([x1, y1]) + margin
    if np.all((points >= low) & (points <= high), axis=1).mean() >= 0.5:
        return []
    (a, b), (c, d) = points.min(axis=0) / MM, points.max(axis=0) / MM
    return [
        f"{file}: points span x {a:.4g} to {c:.4g} and y {b:.4g} to {d:.4g} mm, most of them off the specimen (x "
        f"{x0 / MM:.4g} to {x1 / MM:.4g}, y {y0 / MM:.4g} to {y1 / MM:.4g} mm): points are in mm from the notch mouth"
    ]


def motion_problems(file: str, points: np.ndarray, displacement: np.ndarray, cmod: float, scatter: float) -> list[str]:
    """A sentence where the relative motion in one frame does not go with the CMOD of the same time.

    Parameters
    ----------
    points, displacement : (n, 2) arrays, m, valid points only
    cmod : float, m; frames with a CMOD below ten times `scatter` (m) say nothing
    """
    if len(points) < 3 or not cmod > 10 * scatter:
        return []
    residual = rigid_residual(points, displacement[None], np.ones((1, len(points)), bool))[0]
    motion = float(np.ptp(residual, axis=0).max())
    low, high = MOTION_RANGE
    if low <= motion / cmod <= high:
        return []
    unit = "metres" if motion / cmod < low else "micrometres"
    return [
        f"{file}: its points move {motion / MM:.3g} mm against each other while CMOD is {cmod / MM:.3g} mm: are these "
        f"{unit}? displacement is in mm"
    ]


def view_problems(file: str, table: str, frame: PixelFrame, shape: tuple[int, int], specimen: Specimen) -> list[str]:
    """A sentence where an image of `shape` (rows, columns) hardly shows the specimen, or the specimen hardly it."""
    rows, columns = shape
    corners = frame.placement().to_specimen(np.array([(0, 0), (columns, 0), (0, rows), (columns, rows)], float))
    a, b = corners.min(axis=0), corners.max(axis=0)
    x0, y0, x1, y1 = specimen.bounds
    common = np.prod(np.clip(np.minimum(b, (x1, y1)) - np.maximum(a, (x0, y0)), 0, None))
    if common >= COVER * max((x1 - x0) * (y1 - y0), np.prod(b - a)):
        return []
    return [
        f"{file}: with [{table}] the image covers x {a[0] / MM:.4g} to {b[0] / MM:.4g} and y {a[1] / MM:.4g} to "
        f"{b[1] / MM:.4g} mm, which hardly meets the specimen (x {x0 / MM:.4g} to {x1 / MM:.4g}, y {y0 / MM:.4g} to "
        f"{y1 / MM:.4g} mm): check mm_per_px, origin_px, rotation_deg and mirror"
    ]
