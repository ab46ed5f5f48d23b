"""Whether an identification can succeed, asked before its first simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.units import MM
from pipeline.inverse.objective import Objective, Rigid, compare
from pipeline.inverse.observations import Measured, Simulated
from pipeline.study.assembly import Model

FLAT_TOP = 0.98  # of the peak load, as `LoadCurve.peak` has it: a record that ends above it has not shown its peak


def refuse_hopeless(model: Model, measured: Measured, aim: Objective, rigid: Rigid) -> None:
    """Refuse what no simulation could make good.

    Parameters
    ----------
    model : Model
    measured : Measured
    aim, rigid : what will be compared, and how

    Raises
    ------
    InputError
        where the record ends at its peak, the simulated test ends before the first station, no bond takes
        part in the search, a displacement is impossible, or measurement and simulated test have too little
        in common
    """
    _refuse_peakless(model.bundle.need_curve())
    _refuse_early_end(float(measured.cmod[0]), model.bundle.cmod_max)
    _refuse_fixed(model)
    _refuse_wild(model, measured)
    compare(measured, _everything_until(model.bundle.cmod_max, measured), aim, rigid)


def shows_peak(curve: LoadCurve) -> bool:
    """Whether a record goes on beyond the flat top of its load."""
    return bool(curve.load[-1] <= FLAT_TOP * curve.load.max())


def _refuse_peakless(curve: LoadCurve) -> None:
    if not shows_peak(curve):
        raise InputError(
            f"load_cmod.csv: the record ends at its peak, load_n = {curve.load[-1]:.4g} of {curve.load.max():.4g}: "
            "stations count from the peak on, give a record that goes on beyond it"
        )


def _refuse_early_end(first: float, end: float) -> None:
    if end < first:
        raise InputError(
            f"experiment.toml: [loading] cmod_max_mm = {end / MM:.4g} ends the simulated test before its first CMOD "
            f"station, the measured peak at {first / MM:.4g} mm: raise it, or leave it out"
        )


def _refuse_fixed(model: Model) -> None:
    """Refuse a specimen whose bonds are the same for all values of the unknowns."""
    phases = model.bonds.phase[~model.bonds.protected]
    one, other = (model.mixture.strength(phases, scale, scale)[0] for scale in (1.0, 2.0))
    if np.array_equal(one, other):
        raise InputError(
            "the specimen holds no bond of mastic or interface that could break, so that nothing tells f_max and "
            "delta_max of the mastic: check the specimen's image, or set [material] aggregate_follows = true"
        )


def _refuse_wild(model: Model, measured: Measured) -> None:
    """Refuse displacements larger than the specimen."""
    field = measured.field
    if field is None:
        return
    x0, y0, x1, y1 = model.bundle.specimen.bounds
    moved = np.where(field.valid, np.abs(field.displacement).max(axis=-1), 0.0)
    station, point = np.unravel_index(np.argmax(moved), moved.shape)
    if moved[station, point] > max(x1 - x0, y1 - y0):
        x, y = field.points[point] / MM
        raise InputError(
            f"fields.h5: the point at ({x:.4g}, {y:.4g}) mm moves by {moved[station, point] / MM:.3g} mm at a CMOD of "
            f"{measured.cmod[station] / MM:.3g} mm, farther than the specimen is large: mark it as not valid"
        )


def _everything_until(end: float, measured: Measured) -> Simulated:
    """What simulations give at best: everything up to the end (m) of the test."""
    reached = np.where(measured.cmod <= end, 0.0, np.nan)
    field = measured.field
    shown = None if field is None else np.broadcast_to(reached[:, None, None], field.displacement.shape)[None, None]
    return Simulated(shown, reached[None, None])


def refuse_inert(model: Model, names: Sequence[str], aim: Objective) -> None:
    """Refuse further parameters that this test cannot feel.

    Raises
    ------
    InputError
        for the modulus where no load is compared (fields depend on f_max over K^n alone), and for sliding where
        bonds carry no shear
    """
    if "mastic_modulus" in names and aim is Objective.FIELDS:
        raise InputError(
            "more_parameters: mastic_modulus cannot be found from fields alone, which depend on f_max/K^n only: "
            "compare the load too, with --objective both"
        )
    if "shear_strength_ratio" in names and not model.mixture.shear_ratio:
        raise InputError(
            "more_parameters: shear_strength_ratio cannot be found at "
            f"poissons_ratio = {model.mixture.poissons_ratio:g} in plane {model.mixture.plane}: bonds carry no shear "
            "there (K^s = 0)"
        )
