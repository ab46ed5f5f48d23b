"""Bond stiffness: a hexagonal packing under uniform strain must return the modulus and Poisson's ratio."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.errors import InputError, UnavailableError
from pipeline.materials.elastic import (
    Plane,
    central_force_stiffness,
    normal_stiffness,
    series,
    shear_stiffness,
    stiffness_ratio,
)

RADIUS, THICKNESS = 0.3e-3, 0.04


def packing_stress(k_n: float, k_s: float, strain: np.ndarray, angle: float) -> np.ndarray:
    """Mean stress σ = Σ f ⊗ l/(A t) over the three bonds of a cell of area 2√3 r², without rotation."""
    turn = angle + np.arange(3) * np.pi / 3
    normal = np.column_stack([np.cos(turn), np.sin(turn)])
    tangent = np.column_stack([-np.sin(turn), np.cos(turn)])
    opening = 2 * RADIUS * normal @ strain
    force = k_n * np.sum(opening * normal, 1)[:, None] * normal + k_s * np.sum(opening * tangent, 1)[:, None] * tangent
    return 2 * RADIUS * force.T @ normal / (2 * 3**0.5 * RADIUS**2 * THICKNESS)


def continuum_stress(modulus: float, nu: float, plane: Plane, strain: np.ndarray) -> np.ndarray:
    """Isotropic elasticity with Lamé's constants of the plane."""
    shear = modulus / (2 * (1 + nu))
    lame = modulus * nu / ((1 + nu) * (1 - 2 * nu)) if plane is Plane.STRAIN else modulus * nu / (1 - nu**2)
    return lame * np.trace(strain) * np.eye(2) + 2 * shear * strain


@given(
    nu=st.floats(-0.3, 0.33),
    plane=st.sampled_from(Plane),
    angle=st.floats(0, np.pi),
    strain=st.tuples(*[st.floats(-1e-3, 1e-3)] * 3),
)
def test_a_uniformly_strained_packing_is_the_isotropic_continuum(nu, plane, angle, strain):
    nu = min(nu, plane.central_force_ratio)
    k_n, k_s = (f(1e10, nu, plane, THICKNESS) for f in (normal_stiffness, shear_stiffness))
    exx, eyy, exy = strain
    tensor = np.array([[exx, exy], [exy, eyy]])
    nu = nu if k_s else plane.central_force_ratio
    expected = continuum_stress(1e10, nu, plane, tensor)
    # round-off of sums of terms of the size E × 1e-3
    assert packing_stress(k_n, k_s, tensor, angle) == pytest.approx(expected, abs=1e10 * 1e-3 * 1e-12)


def test_plane_strain_stretches_with_the_modulus_over_one_minus_nu_squared():
    k_n = central_force_stiffness(1e10, 0.25, Plane.STRAIN, THICKNESS)
    free = np.diag([1.0, -0.25 / (1 - 0.25)])  # transverse strain of uniaxial stress in plane strain: −ν/(1 − ν)
    stress = packing_stress(k_n, 0.0, free, 0.3)
    assert stress[0, 0] == pytest.approx(1e10 / (1 - 0.25**2), rel=1e-14)  # round-off
    assert abs(stress[1, 1]) < 1e-14 * stress[0, 0]  # round-off


def test_closed_form_of_the_limits():
    # E t/(√3 · 5/4 · 1/2) and E t/(√3 · 2/3)
    assert central_force_stiffness(1e10, 0.25, Plane.STRAIN, 0.04) == pytest.approx(4e8 / (3**0.5 * 0.625), rel=1e-15)
    assert central_force_stiffness(1e10, 1 / 3, Plane.STRESS, 0.04) == pytest.approx(4e8 * 3**0.5 / 2, rel=1e-15)


@pytest.mark.parametrize("nu", [0.333, 0.3333, 1 / 3, 0.33335])
def test_a_rounded_third_is_a_third(nu):
    assert shear_stiffness(1e10, nu, Plane.STRESS, 0.04) == 0
    exact = central_force_stiffness(1e10, 1 / 3, Plane.STRESS, 0.04)
    assert central_force_stiffness(1e10, nu, Plane.STRESS, 0.04) == exact


@given(nu=st.floats(0.251, 2), plane=st.sampled_from(Plane))
def test_negative_shear_stiffness_is_refused_with_its_limit(nu, plane):
    nu += plane.central_force_ratio - 0.25
    for stiffness in (normal_stiffness, shear_stiffness, central_force_stiffness):
        with pytest.raises(InputError, match=r"limit is 1/4 in plane strain and 1/3 in plane stress"):
            stiffness(1e10, nu, plane, 0.04)


def test_the_papers_ratio_is_refused_and_the_way_out_named():
    with pytest.raises(InputError, match=r"K\^s/K\^n = -0.32.*set poissons_ratio to 1/4; or use plane stress"):
        central_force_stiffness(1e10, 0.33, Plane.STRAIN, 0.04)


@pytest.mark.parametrize(("nu", "plane"), [(0.2, Plane.STRAIN), (0.25, Plane.STRESS), (0.32, Plane.STRESS)])
def test_shear_springs_are_not_in_this_version(nu, plane):
    assert stiffness_ratio(nu, plane) > 0
    with pytest.raises(UnavailableError, match=r"cannot creep.*0\.25 \(plane strain\) or 0\.3333"):
        central_force_stiffness(1e10, nu, plane, 0.04)


@pytest.mark.parametrize(("modulus", "thickness", "word"), [(-1e10, 0.04, "modulus"), (1e10, 0.0, "thickness")])
def test_nonpositive_values_are_refused_by_name(modulus, thickness, word):
    with pytest.raises(InputError, match=word):
        normal_stiffness(modulus, 0.25, Plane.STRAIN, thickness)


def test_series_of_equal_stiffness_is_that_stiffness_and_of_arrays_goes_entry_by_entry():
    assert series(3.0, 3.0) == 3.0
    got = series(np.array([1.0, 2.0]), np.array([3.0, 2.0]))
    assert got == pytest.approx([1 / (0.5 / 1 + 0.5 / 3), 2.0], rel=1e-15)  # half of each material in series
