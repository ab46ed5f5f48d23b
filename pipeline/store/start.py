"""Where the search for f_max and delta_max begins: given, or converted from measured strength and energy."""

from __future__ import annotations

import numpy as np

from pipeline.core.errors import InputError
from pipeline.store.bundle import Bundle
from pipeline.store.sections import MaterialSection

REDUCTION = 0.74  # of the measured values (Hill et al. 2017, after Kim 2007)


def start_parameters(bundle: Bundle, radius: float | None = None) -> tuple[float, float]:
    """f_max (N, per bond of the hexagonal lattice) and delta_max (m) at the centre of the search.

    [start] wins; without it the measured tensile strength and fracture energy are converted as
    [material].conversion says.

    Parameters
    ----------
    bundle : Bundle
    radius : float, m; of the particles where not the bundle's own; f_max/(2 r t) is kept

    Raises
    ------
    InputError
        where neither is given
    """
    own = bundle.model.radius
    radius = own if radius is None else radius
    if bundle.start is not None:
        return bundle.start.f_max_n * radius / own, bundle.start.delta_max_m
    material = bundle.material
    if material.tensile_strength is None or material.fracture_energy is None:
        raise InputError(
            "experiment.toml: neither [start] nor both [material] tensile_strength_mpa and fracture_energy_j_per_m2 "
            "are given: add one of the two, the search needs a centre"
        )
    area = 2 * radius * bundle.specimen.thickness
    return _converted(material, material.tensile_strength, material.fracture_energy, area, bundle.model.lattice_angle)


def _converted(
    material: MaterialSection, strength: float, energy: float, area: float, lattice_angle: float
) -> tuple[float, float]:
    """f_max (N) and delta_max (m) from strength (Pa), energy (J/m²) and the contact area 2rt (m²)."""
    if material.conversion == "contact-area":
        f_max = REDUCTION * strength * area
        return f_max, 2 * REDUCTION * energy * area / f_max
    return lattice_parameters(strength, energy, area, lattice_angle)


def lattice_parameters(strength: float, energy: float, area: float, lattice_angle: float) -> tuple[float, float]:
    """f_max (N) and delta_max (m) for which a hexagonal central-force lattice has this strength and energy.

    A crack whose normal makes the angles φ_k with the three bond directions cuts (2/√3)|cos φ_k| bonds of
    direction k per 2r and thickness, and opens each by w cos φ_k. Σcos²φ_k = 3/2 in every direction, so the
    strength is f_t = √3 f_max/(2rt) whatever the angle; Σ|cos φ_k| = 2 cos(30° − θ), θ being the angle of
    the crack to the nearest close-packed row, so G_f = f_max δ_max/(2rt) · cos(30° − θ)/cos 30°: √3 G_f/f_t
    for rows along the crack, 1.5 G_f/f_t for rows across it.

    Parameters
    ----------
    strength : float, Pa
    energy : float, J/m²
    area : float, m²; 2 r t
    lattice_angle : float, rad; direction of close-packed rows against x, the crack running along y
    """
    f_max = area * strength / np.sqrt(3)
    return float(f_max), float(area * energy / f_max / angle_factor(lattice_angle))


def angle_factor(lattice_angle: float) -> float:
    """cos(30° − θ)/cos 30°: energy of a crack along y against one along the rows; 1 to 2/√3."""
    third = np.pi / 3
    off = (np.pi / 2 - lattice_angle) % third
    theta = min(off, third - off)
    return float(np.cos(np.pi / 6 - theta) / np.cos(np.pi / 6))
