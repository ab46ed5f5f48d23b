"""Energy spent on breaking: areas under measured curves, per area of ligament."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError

END_LOAD = 100.0  # N; ASTM D7313: the test ends when the load has fallen to 0.1 kN


@dataclass(frozen=True)
class WorkOfFracture:
    """What a record spent until the test counted as over.

    Parameters
    ----------
    work : float, J; area under load–CMOD
    energy : float, J/m²; over the area of the ligament
    end : float, m; CMOD up to which was integrated
    complete : bool; False where the record stops before the load has fallen to the end load: the area is then
        a lower bound
    """

    work: float
    energy: float
    end: float
    complete: bool


@dataclass(frozen=True)
class EssentialWork:
    """Essential work of fracture (Cotterell and Reddel 1977): E/(L B) = w_e + β w_p L.

    Parameters
    ----------
    essential : float, J/m²; w_e, of the fracture itself: the intercept
    plastic : float, J/m³; β w_p, of the zone around it: the slope
    covariance : (2, 2) array; of the two, from the scatter about the line; NaN with two ligaments only
    """

    essential: float
    plastic: float
    covariance: np.ndarray


def area(displacement: np.ndarray, force: np.ndarray) -> float:
    """Area (J) under force (n,), N, over displacement (n,), m, by trapezoids.

    Raises
    ------
    InputError
        where the two are not equally long, shorter than two, or not finite
    """
    x, y = np.asarray(displacement, float), np.asarray(force, float)
    if x.ndim != 1 or x.shape != y.shape or x.size < 2:
        raise InputError(f"{y.size} forces for {x.size} displacements: an area needs as many, at least 2")
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise InputError("an area needs finite displacements and forces: remove the rows without a number")
    return float(np.trapezoid(y, x))


def cmod_fracture_energy(curve: LoadCurve, ligament_area: float, end_load: float = END_LOAD) -> WorkOfFracture:
    """Fracture energy as ASTM D7313 reads it: area under load–CMOD until the load has fallen to the end load.

    The end is where the load first falls to `end_load` after its maximum, between two rows linearly. This is
    larger than the machine's work by up to 4 W/S for a hinged beam, and is never converted into it.

    Parameters
    ----------
    curve : LoadCurve
    ligament_area : float, m²
    end_load : float, N, zero or positive

    Raises
    ------
    InputError
        for a ligament without area, and a record that never exceeds the end load
    """
    if not (np.isfinite(ligament_area) and ligament_area > 0):
        raise InputError(f"ligament area {ligament_area:g} m² must be positive and finite")
    top = int(np.argmax(curve.load))
    if not 0 <= end_load < curve.load[top]:
        raise InputError(
            f"end load {end_load:g} N must be zero or positive, and below the peak of {curve.load[top]:g} N"
        )
    fallen = np.flatnonzero(curve.load[top:] <= end_load)
    x, y = curve.cmod, curve.load
    if fallen.size:
        x, y = _until(x, y, top + int(fallen[0]), end_load)
    work = area(x, y)
    return WorkOfFracture(work, work / ligament_area, float(x[-1]), bool(fallen.size))


def essential_work(ligament: np.ndarray, thickness: float, energy: np.ndarray) -> EssentialWork:
    """The line through energies per area over the length of the ligament.

    Parameters
    ----------
    ligament : (n,) array, m; two different lengths at least, replicates as they come
    thickness : float, m
    energy : (n,) array, J

    Raises
    ------
    InputError
        for fewer than two lengths, and sizes that are not positive
    """
    length, spent = np.asarray(ligament, float), np.asarray(energy, float)
    if length.shape != spent.shape or np.unique(length).size < 2:
        raise InputError("essential work of fracture needs energies at two ligament lengths or more, one each")
    if not (thickness > 0 and (length > 0).all() and np.isfinite(spent).all()):
        raise InputError("ligaments and thickness must be positive, energies finite")
    design = np.column_stack([np.ones_like(length), length])
    specific = spent / (length * thickness)
    fit, *_ = np.linalg.lstsq(design, specific, rcond=None)
    spare = length.size - 2
    scatter = float(np.sum((design @ fit - specific) ** 2)) / spare if spare else float("nan")
    return EssentialWork(float(fit[0]), float(fit[1]), scatter * np.linalg.inv(design.T @ design))


def _until(x: np.ndarray, y: np.ndarray, row: int, load: float) -> tuple[np.ndarray, np.ndarray]:
    """A curve cut where it falls to a load between the row before and this one."""
    share = (y[row - 1] - load) / (y[row - 1] - y[row])
    end = x[row - 1] + share * (x[row] - x[row - 1])
    return np.append(x[:row], end), np.append(y[:row], load)
