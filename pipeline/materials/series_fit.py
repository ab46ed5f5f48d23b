"""Series of positive terms fitted to creep compliance, relaxation modulus or dynamic modulus.

Times of the terms are laid out in equal steps of their logarithm; sizes follow by non-negative least squares
of relative differences (Lawson and Hanson 1974). What is fitted is admissible whatever the data: no energy
is made, also from records or tables with a negative term.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear, nnls

from pipeline.core.errors import InputError
from pipeline.materials.kelvin_chain import KelvinChain
from pipeline.materials.prony import PronySeries

PER_DECADE = 2.0  # terms a decade: ripples of half a percent in D, two in E; with one three times as much
FLOOR = 1e-3  # of the smallest measured compliance: D(0), which no record shows, cannot be less


def spaced_times(first: float, last: float, per_decade: float = PER_DECADE) -> np.ndarray:
    """Times (k,), s, in equal steps of their logarithm from `first` to `last`, at least one.

    Raises
    ------
    InputError
        where the two are not positive and increasing
    """
    if not (0 < first <= last and np.isfinite(last)):
        raise InputError(f"times of a series from {first:g} to {last:g} s: they must be positive and increase")
    return np.geomspace(first, last, max(int(np.ceil(np.log10(last / first) * per_decade)) + 1, 1))


def fit_creep(time: np.ndarray, compliance: np.ndarray, terms: np.ndarray, *, flows: bool = True) -> KelvinChain:
    """The Kelvin chain with given retardation times that fits a creep compliance best, relatively.

    Parameters
    ----------
    time : (n,) array, s
    compliance : (n,) array, 1/Pa, positive
    terms : (k,) array, s; retardation times, those of no use are left out
    flows : bool; let there be a dashpot, φ t
    """
    refuse_data(time, compliance, "compliance", "1/Pa")
    design = creep_design(time, terms, flows)
    least = FLOOR * float(compliance.min())
    size = not_negative(design / compliance[:, None], 1 - least / compliance)
    return _chain(size, terms, flows, least)


def creep_design(time: np.ndarray, terms: np.ndarray, flows: bool) -> np.ndarray:
    """Columns (n, k + 1 or 2) of D_0, φ (where it flows) and the D_j in D(t)."""
    retarded = -np.expm1(-np.divide.outer(time, terms))
    return np.column_stack([np.ones_like(time), *([time] if flows else []), retarded])


def fit_relaxation(time: np.ndarray, modulus: np.ndarray, terms: np.ndarray, *, flows: bool = False) -> PronySeries:
    """The Prony series with given relaxation times that fits a relaxation modulus best, relatively.

    Parameters
    ----------
    time : (n,) array, s
    modulus : (n,) array, Pa, positive
    terms : (k,) array, s; relaxation times, those of no use are left out
    flows : bool; no modulus is left at the end, E_∞ = 0
    """
    refuse_data(time, modulus, "modulus", "Pa")
    arms = np.exp(-np.divide.outer(time, terms))
    design = arms if flows else np.column_stack([np.ones_like(time), arms])
    size = not_negative(design / modulus[:, None], np.ones_like(modulus))
    return _series(size, terms, flows)


def fit_dynamic(frequency: np.ndarray, modulus: np.ndarray, terms: np.ndarray, *, flows: bool = False) -> PronySeries:
    """The Prony series that fits a complex modulus best, both parts relative to its magnitude.

    Parameters
    ----------
    frequency : (n,) array, rad/s
    modulus : (n,) complex array, Pa; E' + iE'', or G' + iG'' for a series of shear moduli
    terms : (k,) array, s
    flows : bool; no modulus is left at the lowest frequency
    """
    refuse_data(frequency, np.abs(modulus), "modulus", "Pa", "frequency", "rad/s")
    design, wanted = dynamic_system(frequency, modulus, terms, flows)
    size = not_negative(design, wanted)
    return _series(size, terms, flows)


def dynamic_system(
    frequency: np.ndarray, modulus: np.ndarray, terms: np.ndarray, flows: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Columns (2n, k or k + 1) and right-hand side (2n,) of a fit to both parts of a complex modulus."""
    turn = 1j * np.multiply.outer(frequency, terms)
    arms = turn / (1 + turn)
    whole = arms if flows else np.column_stack([np.ones_like(frequency), arms])
    relative = whole / np.abs(modulus)[:, None]
    unit = modulus / np.abs(modulus)
    return np.vstack([relative.real, relative.imag]), np.concatenate([unit.real, unit.imag])


def not_negative(design: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The combination of columns without negative factors that comes nearest to `wanted`; (k,) from (n, k) and (n,).

    Columns are first brought to length 1: their factors then differ by no more decades than the data do.
    """
    length = np.linalg.norm(design, axis=0)
    length[length == 0] = 1.0
    try:
        size, _ = nnls(design / length, wanted, maxiter=100 * design.shape[1])
    except RuntimeError:  # it goes in circles where columns can hardly be told apart
        size = lsq_linear(design / length, wanted, (0, np.inf), method="bvls").x
    return np.maximum(size, 0.0) / length


def refuse_data(
    x: np.ndarray, y: np.ndarray, name: str, unit: str, abscissa: str = "time", abscissa_unit: str = "s"
) -> None:
    """Refuse data that are not positive finite numbers, pair by pair."""
    if np.shape(x) != np.shape(y) or np.ndim(x) != 1 or not np.size(x):
        raise InputError(f"{np.size(y)} values of {name} for {np.size(x)} of {abscissa}: one each is needed")
    for what, values, its_unit in ((abscissa, x, abscissa_unit), (name, y, unit)):
        good = np.isfinite(values) & (np.asarray(values) > 0)
        if not good.all():
            raise InputError(f"{what} = {np.asarray(values)[~good][0]:g} {its_unit} must be positive and finite")


def _chain(size: np.ndarray, terms: np.ndarray, flows: bool, least: float) -> KelvinChain:
    retarded, used = size[1 + flows :], size[1 + flows :] > 0
    return KelvinChain(least + float(size[0]), float(size[1]) if flows else 0.0, retarded[used], terms[used])


def _series(size: np.ndarray, terms: np.ndarray, flows: bool) -> PronySeries:
    arms, used = size[not flows :], size[not flows :] > 0
    if not used.any():
        raise InputError("the data show no relaxation: no positive series with these times fits them")
    return PronySeries(0.0 if flows else float(size[0]), arms[used], terms[used])
