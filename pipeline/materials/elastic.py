"""Stiffness of the bonds of a hexagonal packing from the modulus of the continuum."""

from __future__ import annotations

from enum import StrEnum
from typing import TypeVar

import numpy as np

from pipeline.core.errors import InputError, UnavailableError

Number = TypeVar("Number", float, np.ndarray)

CENTRAL_FORCE_TOLERANCE = 1e-3
"""|K^s|/K^n below which ν is taken as the exact limit: ν = 0.333 and 0.3333 both mean 1/3."""


class Plane(StrEnum):
    """The plane state of a section."""

    STRAIN = "strain"
    STRESS = "stress"

    @property
    def central_force_ratio(self) -> float:
        """Poisson's ratio at which K^s = 0: 1/4 in plane strain, 1/3 in plane stress."""
        return 1 / 4 if self is Plane.STRAIN else 1 / 3


def stiffness_ratio(poissons_ratio: float, plane: Plane) -> float:
    """K^s/K^n of a hexagonal packing, Hill et al. 2017 eq. (4) and its plane-stress twin.

    Plane strain 1 − 4ν, plane stress (1 − 3ν)/(1 + ν); exactly 0 within `CENTRAL_FORCE_TOLERANCE`.

    Raises
    ------
    InputError
        if ν makes K^s negative, or is not above −1
    """
    nu = _checked_ratio(poissons_ratio)
    ratio = 1 - 4 * nu if plane is Plane.STRAIN else (1 - 3 * nu) / (1 + nu)
    if abs(ratio) < CENTRAL_FORCE_TOLERANCE:
        return 0.0
    if ratio < 0:
        raise InputError(_negative_shear(nu, ratio, plane))
    return ratio


def normal_stiffness(modulus: Number, poissons_ratio: float, plane: Plane, thickness: float) -> Number:
    """Normal stiffness K^n of a bond (N/m), Hill et al. 2017 eq. (4) times the thickness.

    Plane strain E t/(√3 (1 + ν)(1 − 2ν)), plane stress E t/(√3 (1 − ν)).

    Parameters
    ----------
    modulus : float or (m,) array, Pa
    poissons_ratio : float; taken as the exact limit where K^s is zero within the tolerance
    plane : Plane
    thickness : float, m

    Raises
    ------
    InputError
        for a modulus or thickness that is not positive, and for ν beyond the limit (K^s < 0)
    """
    _refuse_nonpositive("modulus", modulus)
    _refuse_nonpositive("thickness", thickness)
    nu = poissons_ratio
    if stiffness_ratio(nu, plane) == 0:
        nu = plane.central_force_ratio
    share = (1 + nu) * (1 - 2 * nu) if plane is Plane.STRAIN else 1 - nu
    return modulus * (thickness / (3**0.5 * share))


def shear_stiffness(modulus: Number, poissons_ratio: float, plane: Plane, thickness: float) -> Number:
    """Shear stiffness K^s of a bond (N/m), Hill et al. 2017 eq. (4) times the thickness.

    Arguments and refusals as in `normal_stiffness`; plane strain K^n (1 − 4ν), plane stress
    K^n (1 − 3ν)/(1 + ν).
    """
    return normal_stiffness(modulus, poissons_ratio, plane, thickness) * stiffness_ratio(poissons_ratio, plane)


def central_force_stiffness(modulus: Number, poissons_ratio: float, plane: Plane, thickness: float) -> Number:
    """K^n (N/m) of a packing whose bonds carry no shear: ν = 1/4 (plane strain) or 1/3 (plane stress).

    Arguments as in `normal_stiffness`.

    Raises
    ------
    InputError
        if K^s < 0
    UnavailableError
        if K^s > 0, which bonds that creep cannot have
    """
    ratio = stiffness_ratio(poissons_ratio, plane)
    if ratio > 0:
        raise UnavailableError(
            f"poissons_ratio = {poissons_ratio:g} in plane {plane} gives K^s/K^n = {ratio:.3g}: bonds with shear "
            "stiffness cannot creep; use poissons_ratio = 0.25 "
            "(plane strain) or 0.3333 (plane stress)"
        )
    return normal_stiffness(modulus, poissons_ratio, plane, thickness)


def series(first: Number, second: Number) -> Number:
    """Stiffness of a bond half of one material, half of the other: 2 K₁ K₂/(K₁ + K₂), N/m."""
    return 2 * first * second / (first + second)


def _checked_ratio(nu: float) -> float:
    if not nu > -1:
        raise InputError(f"poissons_ratio = {nu:g} must be above -1: use a ratio between 0 and the limit of the plane")
    return nu


def _refuse_nonpositive(name: str, value: float | np.ndarray) -> None:
    if not (np.all(np.isfinite(value)) and np.all(np.asarray(value) > 0)):
        raise InputError(f"{name} = {np.min(value):g} must be positive and finite (SI units: Pa, m)")


def _negative_shear(nu: float, ratio: float, plane: Plane) -> str:
    limit = "1/4" if plane is Plane.STRAIN else "1/3"
    other = "; or use plane stress, whose limit is 1/3" if plane is Plane.STRAIN and nu <= 1 / 3 + 1e-3 else ""
    return (
        f"poissons_ratio = {nu:g} in plane {plane} gives a negative shear stiffness (K^s/K^n = {ratio:.3g}), with "
        "which a packing is unstable: in a hexagonal packing the limit is 1/4 in plane strain and 1/3 in plane "
        f"stress; set poissons_ratio to {limit}{other}"
    )
