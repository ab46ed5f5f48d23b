"""Bonds that creep in equilibria: no creep is elastic, convergence in time, energy, jumps, agreement with LAMMPS."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.clock import steady
from pipeline.core.errors import InputError
from pipeline.core.problem import Kinematics, Problem, Solution
from pipeline.core.units import GPA, MM
from pipeline.equilibrium.path import Increments
from pipeline.equilibrium.solve import solve
from pipeline.lmp import simulate as lammps
from pipeline.materials.burgers import Burgers
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.relaxation import Arms

from .specimens import fracture_test

MASTIC = Burgers(0.1 / GPA, 0.04 / GPA, 1500 * GPA, 15.0)


@pytest.fixture(scope="module")
def creeping() -> Problem:
    """A two-phase SE(B) through failure: the compliance of its mastic grows by half meanwhile."""
    return small_beam(2 * MM, cmod_max=0.3 * MM, mastic=MASTIC)


@pytest.fixture(scope="module")
def solution(creeping: Problem) -> Solution:
    return solve(creeping)


def apart(one: Solution, other: Solution, end: float = 0.3 * MM) -> float:
    """Difference of two loads over the CMOD, relative."""
    at = np.linspace(0.03, 0.97, 80) * end
    wanted = other.curve.load_at(at)
    return float(np.linalg.norm(one.curve.load_at(at) - wanted) / np.linalg.norm(wanted))


@pytest.mark.parametrize("kinematics", list(Kinematics))
def test_without_creep_it_is_the_elastic_engine(kinematics: Kinematics) -> None:
    elastic = replace(fracture_test(radius=2 * MM, scatter=0.2, kinematics=kinematics), cmod_max=0.2 * MM)
    law, m = elastic.law, elastic.bonds.count
    rise = Arms(np.zeros((m, 1)), np.ones((m, 1)), law.k_n)
    still = replace(elastic, law=CreepingSoftening(rise, law.f_max, law.delta_max), clock=steady(1e-5))
    found, wanted = solve(still), solve(elastic, condensed=False)
    assert apart(found, wanted, 0.2 * MM) < 5e-4  # the tolerance, 2e-4 f_max, in the load of some tens of bonds
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-3 * np.abs(wanted.displacement).max())
    assert found.energy.dissipated == pytest.approx(law.dissipated(found.reached).sum(), rel=1e-9)  # sums of steps


def test_energy_and_stations(creeping: Problem, solution: Solution) -> None:
    assert solution.energy.error < 1e-3  # asked for: stored, dashpots and softening against the machine's work
    assert solution.energy.dissipated > creeping.law.dissipated(solution.reached).sum()  # the dashpots' share
    assert np.count_nonzero(solution.reached >= creeping.law.delta_max) > 3
    assert solution.cmod == pytest.approx(creeping.stations)
    assert [creeping.gauge.cmod(u) for u in solution.displacement] == pytest.approx(creeping.stations, rel=1e-12)


def test_shorter_increments_converge(creeping: Problem, solution: Solution) -> None:
    """Openings that are not linear in time are the error of an increment: second order, and little at the default."""
    shares = [Increments(1 / 160 / k, 1 / 320 / k, fading=0.02 / k) for k in (1 / 3, 4)]
    coarse, limit = (solve(creeping, increments=share, tolerance=5e-5) for share in shares)
    assert apart(solution, limit) < 1e-3  # measured 2e-4
    assert apart(solution, limit) < 0.5 * apart(coarse, limit)


def test_a_bond_that_fades_fast_shortens_increments(creeping: Problem, solution: Solution) -> None:
    careful = solve(creeping, increments=Increments(fading=0.004))
    assert careful.steps > 1.5 * solution.steps
    assert apart(careful, solution) < 1e-3  # as above


def test_a_slower_test_creeps_more(creeping: Problem, solution: Solution) -> None:
    """So slow that mastic flows there is little load; so fast that nothing flows it is elastic."""
    slow = solve(replace(creeping, clock=steady(creeping.cmod_rate / 10)))
    fast = solve(replace(creeping, clock=steady(1e6 * creeping.cmod_rate)))
    law = creeping.law
    elastic = solve(replace(creeping, clock=None, law=law.without_creep), condensed=False)
    assert apart(fast, elastic) < 5e-4  # the tolerance, as above
    at = 0.01 * MM  # before any damage
    loads = [s.curve.load_at(np.array([at]))[0] for s in (slow, solution, fast)]
    assert np.all(np.diff(loads) > 0)


def test_the_machine_that_only_moves_forward_sees_the_same_clock(creeping: Problem, solution: Solution) -> None:
    forward = solve(creeping, snap_back=False)
    assert apart(forward, solution) < 1e-3  # no jump here: only control differs


def test_energy_balances_through_jumps_of_creeping_specimens() -> None:
    brittle = fracture_test(radius=2.5 * MM, scatter=0.8, opening=0.3e-4)
    law = brittle.law
    share, time = np.array([0.25, 0.35]), np.array([5.0, 40.0])
    rise = Arms(np.multiply.outer(law.k_n, share), np.broadcast_to(time, (law.k_n.size, 2)), 0.4 * law.k_n)
    creeping = CreepingSoftening(rise, law.f_max, law.delta_max)
    for snap_back in (True, False):
        found = solve(replace(brittle, law=creeping, clock=steady(1e-5)), snap_back=snap_back)
        assert "jumped" in found.message
        assert found.energy.damping > 1e-3 * found.energy.external  # the balance would be missed without it
        assert found.energy.error < 1e-3  # asked for


def test_lammps_tends_to_it(creeping: Problem, solution: Solution) -> None:
    """Through failure; the slower, the nearer, as without creep."""
    errors = [apart(lammps.solve(replace(creeping, accuracy=a)), solution) for a in (0.03, 0.005)]
    assert errors[1] < 0.005  # what was asked of it
    assert errors[1] < 0.5 * errors[0]


def test_creep_without_a_clock_and_a_clock_without_creep_are_refused(creeping: Problem) -> None:
    with pytest.raises(InputError, match="bonds that creep need the time of the test"):
        solve(replace(creeping, clock=None))
    with pytest.raises(InputError, match="but no bond creeps: leave it out"):
        solve(replace(fracture_test(), clock=steady(1e-5)))
