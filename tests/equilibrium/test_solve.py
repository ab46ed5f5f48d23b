"""The engine against closed forms, conserved quantities and symmetries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.problem import Kinematics, Problem
from pipeline.core.specimen import SingleEdgeNotchedBeam
from pipeline.core.units import MM
from pipeline.equilibrium.model import whole_model
from pipeline.equilibrium.path import Increments
from pipeline.equilibrium.solve import solve
from pipeline.equilibrium.step import Stepper
from pipeline.materials.cohesive import LinearSoftening

from .specimens import DISK, MODULUS, chain, elastic, fracture_test, mirrored, scaled, strip

LAW = LinearSoftening(np.array([4e8]), np.array([80.0]), np.array([1e-5]))  # δ_peak 0.2 µm, slope −8.2e6 N/m


@pytest.mark.parametrize("kinematics", list(Kinematics))
def test_one_bond_follows_its_law(kinematics: Kinematics) -> None:
    """In series with a stiff spring the machine is always ahead of the bond."""
    solution = solve(chain(1e9, LAW, 1.2e-5, kinematics))
    curve = solution.curve
    law = LAW.force(curve.cmod, np.zeros(1))
    assert curve.load == pytest.approx(law, abs=2e-3 * 80)  # residual of 1e-3 f_max on either side of the bond
    assert curve.load_line == pytest.approx(curve.cmod + curve.load / 1e9, abs=1e-3 * 80 / 1e9)
    assert curve.load.max() == pytest.approx(80, rel=2e-3)
    assert solution.energy.dissipated == pytest.approx(0.5 * 80 * 1e-5, rel=1e-12)


def test_snap_back_is_followed_under_cmod_control() -> None:
    """A spring softer than the softening slope (8.2e6 N/m) makes the machine displacement go back."""
    spring = 4e6
    solution = solve(chain(spring, LAW, 1.2e-5), increments=Increments(far=1 / 40, near=1 / 80))
    curve = solution.curve
    assert np.diff(curve.load_line).min() < 0
    assert np.diff(curve.cmod).min() > 0
    assert curve.load == pytest.approx(LAW.force(curve.cmod, np.zeros(1)), abs=2e-3 * 80)  # residual
    assert curve.load_line == pytest.approx(curve.cmod + curve.load / spring, abs=2e-3 * 80 / spring)
    assert solution.energy.error < 1e-3  # no energy is lost in a jump
    assert "jump" not in solution.message


def test_uniaxial_patch() -> None:
    """Uniform strain along the rows: only their bonds carry force, and the patch contracts by ν = 1/3."""
    k, problem = 1e8, strip(12, 9, 1e8)
    solution = solve(problem)
    length, spacing = np.ptp(problem.particles.position[:, 0]), 2 * MM
    strain = solution.curve.cmod[-1] / length
    work = 9 * 11 * k * (spacing * strain) ** 2  # 9 rows of 11 bonds
    assert solution.curve.load[-1] * solution.curve.cmod[-1] == pytest.approx(work, rel=1e-9)  # round-off of a solve
    height = problem.particles.position[:, 1]
    rise = solution.displacement[0][:, 1] / (solution.cmod[0] / length)
    assert rise == pytest.approx(-height / 3, abs=1e-9)


def test_compliance_of_the_notched_beam() -> None:
    """CMOD = 24 P a V₁(a/W)/(t W E') at S/W = 4 (Tada, Paris & Irwin 2000, § 2.16).

    The formula is stated to be within 1 %; an independent linear finite-element solution (bilinear squares
    of 1, 0.5, 0.25 mm: 0.9934, 1.0045, 1.0101 of the formula) tends to 1.0157 of it, and so does the lattice.
    """
    beam = SingleEdgeNotchedBeam(
        depth=60 * MM, span=240 * MM, length=250 * MM, thickness=40 * MM, notch_length=15 * MM, gauge_length=0.5 * MM
    )
    share = 0.25
    shape = 0.76 - 2.28 * share + 3.87 * share**2 - 2.04 * share**3 + 0.66 / (1 - share) ** 2
    exact = 24 * 15 * MM * shape / (40 * MM * 60 * MM * MODULUS / (1 - 0.25**2))
    ratio = []
    for radius in (1.5 * MM, 0.75 * MM):
        state = Stepper(whole_model(elastic(fracture_test(beam, radius)))).elastic()
        ratio.append(state.cmod / state.load / exact)
    coarse, fine = ratio
    assert abs(fine - 1) < abs(coarse - 1)
    assert 2 * fine - coarse == pytest.approx(1.0157, abs=0.005)  # first order in r; what is left is second order


@pytest.fixture(scope="module")
def beam() -> Problem:
    """Scatter breaks the tie between cracks to the left and to the right, which round-off would decide."""
    return replace(fracture_test(scatter=0.2), cmod_max=0.35 * MM)


@pytest.fixture(scope="module")
def beam_solution(beam: Problem):
    return solve(beam)


def test_energy_balance_and_residual(beam_solution) -> None:
    assert beam_solution.converged
    assert beam_solution.energy.error < 1e-3  # trapezoids over some 80 increments
    assert beam_solution.quasi_static_error < 1e-3


def test_stations_are_hit(beam: Problem, beam_solution) -> None:
    read = [beam.gauge.cmod(u) for u in beam_solution.displacement]
    assert read == pytest.approx(beam.stations, rel=1e-12)  # interpolation is linear, so is the gauge
    assert beam_solution.cmod == pytest.approx(beam.stations)


def test_grips_and_reactions(beam: Problem, beam_solution) -> None:
    means = {g.name: g.mean(beam_solution.displacement[0]) for g in beam.grips}
    assert means["left"] == pytest.approx(0, abs=1e-15)
    machine = np.interp(beam.stations[0], beam_solution.curve.cmod, beam_solution.curve.load_line)
    assert means["platen"] == pytest.approx(machine, rel=1e-9)


def test_tighter_tolerance_changes_little(beam: Problem, beam_solution) -> None:
    fine = solve(beam, tolerance=1e-5)
    at = np.linspace(0.02, 0.34, 40) * MM
    coarse_load, fine_load = beam_solution.curve.load_at(at), fine.curve.load_at(at)
    assert np.linalg.norm(coarse_load - fine_load) < 5e-4 * np.linalg.norm(fine_load)  # measured 9e-5
    off = np.linalg.norm(beam_solution.displacement - fine.displacement)
    assert off < 3e-4 * np.linalg.norm(fine.displacement)  # measured 3e-5


def test_mirror_symmetry(beam: Problem) -> None:
    """The order of elimination goes from left to right: single precision measures other steps to the same end."""
    first, again = (solve(problem, tolerance=1e-7) for problem in (beam, mirrored(beam)))
    assert again.curve.load == pytest.approx(first.curve.load, rel=1e-6)  # round-off through many steps
    assert again.displacement * (-1, 1) == pytest.approx(first.displacement, abs=1e-6 * 1e-4)


def test_scaling_law(beam: Problem) -> None:
    """(s f_max, s δ_max): u(s·CMOD) = s·u(CMOD) and P → s·P, iteration by iteration."""
    short = replace(beam, cmod_max=0.15 * MM, stations=np.array([0.05, 0.1]) * MM)
    plain, twice = solve(short), solve(scaled(short, 2.0))
    assert twice.displacement == pytest.approx(2 * plain.displacement, rel=1e-9, abs=1e-15)  # round-off, many steps
    assert twice.curve.load == pytest.approx(2 * plain.curve.load, rel=1e-9, abs=1e-9)


def test_disk_compact_tension_and_finite_kinematics() -> None:
    """Small and finite kinematics agree while rotations are small: DC(T) turns by 0.003 rad at this opening."""
    problem = replace(fracture_test(DISK, 2.5 * MM, scatter=0.2), cmod_max=0.2 * MM, stations=np.array([0.1 * MM]))
    small = solve(problem)
    finite = solve(replace(problem, kinematics=Kinematics.FINITE))
    assert small.energy.error < 1e-3  # trapezoids
    assert finite.energy.error < 1e-3
    peak = [s.curve.peak()[1] for s in (small, finite)]
    assert peak[0] == pytest.approx(peak[1], rel=0.01)


def test_a_loose_specimen_is_refused(beam: Problem) -> None:
    with pytest.raises(InputError, match="the elastic stiffness of the specimen is singular"):
        solve(replace(beam, grips=beam.grips[:1]))


def test_failure_to_converge_is_raised_or_said(beam: Problem) -> None:
    with pytest.raises(ConvergenceError, match="no equilibrium found beyond CMOD"):
        solve(beam, tolerance=1e-13, limit=3)
    stopped = solve(beam, tolerance=1e-6, limit=9, strict=False)
    assert not stopped.converged
    assert "no equilibrium found" in stopped.message


def test_bad_settings_are_refused(beam: Problem) -> None:
    with pytest.raises(InputError, match="tolerance = 2 must lie between 0 and 1"):
        solve(beam, tolerance=2)
    with pytest.raises(InputError, match="cmod_max = -1 m must be positive"):
        solve(replace(beam, cmod_max=-1.0))
