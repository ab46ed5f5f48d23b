"""Elastic compliances of lattices against finite elements that share nothing with them but geometry and grips."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.plane_elements import mesh_of, response, stiffness

from pipeline.core.problem import Kinematics, Problem
from pipeline.core.specimen import DiskCompactTension, Specimen
from pipeline.core.units import GPA, MM
from pipeline.equilibrium.model import whole_model
from pipeline.equilibrium.step import Stepper
from pipeline.materials.cohesive import LinearSoftening
from pipeline.materials.elastic import Plane, normal_stiffness
from pipeline.microstructure.attachment import attach_gauge, attach_grips
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phases import lay_phases
from pipeline.study.closed_forms import LONG_BEAM, elastic_compliances, tada_cmod, tada_notch_compliance

DISK = DiskCompactTension(
    diameter=150 * MM, width=110 * MM, edge_to_load_line=35 * MM, thickness=50 * MM, notch_length=27.5 * MM
)
MODULUS, POISSON = 10 * GPA, 0.25


def by_elements(specimen: Specimen, pitch: float, notched: bool = True) -> np.ndarray:
    """CMOD and machine displacement over load (m/N)."""
    mesh = mesh_of(specimen, pitch, notched)
    nodes = mesh.as_particles(pitch)
    matrix = stiffness(mesh, MODULUS, POISSON, specimen.thickness)
    return np.array(response(matrix, attach_grips(specimen, nodes), attach_gauge(specimen, nodes)))


def by_lattice(specimen: Specimen, radius: float) -> np.ndarray:
    """CMOD and machine displacement over load (m/N)."""
    particles, bonds, _ = lay_phases(specimen, hexagonal_packing(specimen, radius, np.pi / 2))
    k_n = np.full(bonds.count, normal_stiffness(MODULUS, POISSON, Plane.STRAIN, specimen.thickness))
    law = LinearSoftening(k_n, np.full_like(k_n, np.inf), np.full_like(k_n, np.inf))
    grips, gauge = attach_grips(specimen, particles), attach_gauge(specimen, particles)
    end = np.array([1e-4])
    problem = Problem(specimen, particles, bonds, law, grips, gauge, Kinematics.SMALL, 1e-4, end)
    state = Stepper(whole_model(problem)).elastic()
    return np.array([state.cmod, 1.0]) / state.load


def test_a_patch_of_elements_is_exact() -> None:
    """Under an affine displacement the energy is that of the strain, whatever the triangles."""
    mesh = mesh_of(LONG_BEAM, 6 * MM, notched=False)
    matrix = stiffness(mesh, MODULUS, POISSON, LONG_BEAM.thickness)
    strain = np.array([[1e-4, 3e-5], [3e-5, -2e-5]])
    moved = (mesh.nodes @ strain).ravel()
    lame = MODULUS * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    shear = MODULUS / (2 * (1 + POISSON))
    density = 0.5 * lame * np.trace(strain) ** 2 + shear * np.sum(strain**2)
    volume = LONG_BEAM.length * LONG_BEAM.depth * LONG_BEAM.thickness
    assert 0.5 * moved @ matrix @ moved == pytest.approx(density * volume, rel=1e-9)  # round-off


def test_disk_compact_tension() -> None:
    """Lattices extrapolated to r = 0 against elements of half the pitch.

    Over load, at 1, 0.5 mm and extrapolated: mouth 36.3, 35.3, 34.4 nm/N, pins 25.9, 25.4, 24.9 nm/N; elements of
    4, 2.8, 2 mm: 34.8, 35.1, 34.8 and 24.3, 25.0, 25.0 nm/N.
    """
    coarse, fine = by_lattice(DISK, 1 * MM), by_lattice(DISK, 0.5 * MM)
    rough, elements = by_elements(DISK, 4 * MM), by_elements(DISK, 2 * MM)
    assert elements == pytest.approx(rough, rel=0.03)  # the loaded rim of a hole is 1 mm deep, or one element
    assert 2 * fine - coarse == pytest.approx(elements, rel=0.02)  # what refining changes yet, on both sides
    assert np.all(np.abs(fine / elements - 1) < np.abs(coarse / elements - 1)), "lattices converge"


def test_single_edge_notched_beam() -> None:
    """Elements and lattice agree nearer with each other than with Tada's formulas, stated to be within 1 %."""
    whole, sound = by_elements(LONG_BEAM, 2 * MM), by_elements(LONG_BEAM, 2 * MM, notched=False)
    share = np.array([whole[0] / tada_cmod(LONG_BEAM), (whole - sound)[1] / tada_notch_compliance(LONG_BEAM)])
    assert share == pytest.approx([1, 1], abs=0.015)  # 1 % of the formulas, and the gauge 0.25 mm beside the notch
    lattice = 2 * np.array(elastic_compliances(0.75 * MM)) - np.array(elastic_compliances(1.5 * MM))
    # elements of 4, 2.8, 2 mm: 0.990, 0.993, 1.002 at the mouth and 0.985, 0.992, 1.007, still growing
    assert lattice == pytest.approx(share, abs=0.03)
