"""The NumPy engine against closed forms and conserved quantities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.beams import small_beam

from pipeline.core.errors import ConvergenceError
from pipeline.core.problem import Kinematics, Problem, Role
from pipeline.core.units import MM
from pipeline.equilibrium import solve as equilibrium
from pipeline.reference.body import body_of
from pipeline.reference.drive import ERROR_PER_EXCESS, Drive, Energies
from pipeline.reference.solve import Run, expectation, solve
from pipeline.reference.step import Damping, State, advance, at_rest_place, with_bond_forces


@pytest.fixture(scope="module")
def beam() -> Problem:
    """A two-phase SE(B) of 294 particles."""
    return small_beam(2.8 * MM, cmod_max=0.15 * MM)


def free(problem: Problem) -> Problem:
    """The same specimen, held by nothing."""
    return replace(problem, grips=())


def test_a_bond_swings_as_leapfrog_does(beam: Problem) -> None:
    """cos(ω̃ k) with 2 sin(ω̃/2) = ω of a free pair, (m₁ + m₂)/(m₁ m₂) k = ω²; half a step of phase."""
    pair = free(beam)
    one = replace(
        pair.bonds, pairs=pair.bonds.pairs[:1], phase=pair.bonds.phase[:1], protected=pair.bonds.protected[:1]
    )
    law = beam.law.of(np.array([0]))
    pair = replace(pair, bonds=one, law=type(law)(law.k_n, np.full(1, np.inf), law.delta_max))
    body = replace(body_of(beam), problem=pair, length=body_of(beam).length[:1], direction=body_of(beam).direction[:1])
    first, second = one.pairs[0]
    stretched = np.array(beam.particles.position)
    stretched[second] += 1e-6 * body.direction[0]
    still = at_rest_place(body, np.zeros_like(stretched))
    state: State = with_bond_forces(body, replace(still, position=stretched), 0.0)
    masses = body.mass[[first, second]]
    phase = 2 * np.arcsin(np.sqrt(law.k_n[0] * np.sum(1 / masses)) / 2)
    openings = []
    for _ in range(50):
        state, _ = advance(body, state, Damping(0.0, 0.0), 0.0)
        openings.append(state.opening[0])
    # at rest half a step before the start: the swing is centred there
    expected = 1e-6 * np.cos(phase * (np.arange(1, 51) + 0.5)) / np.cos(phase / 2)
    assert openings == pytest.approx(expected, abs=1e-9 * 1e-6)  # positions of 0.05 m have a round-off of 7e-18 m


@pytest.mark.parametrize("kinematics", list(Kinematics))
def test_a_free_specimen_keeps_its_momentum(beam: Problem, kinematics: Kinematics) -> None:
    body = body_of(free(replace(beam, kinematics=kinematics)))
    random = np.random.default_rng(3)
    state = at_rest_place(body, random.normal(0, 1e-8, (beam.particles.count, 2)))
    before = body.mass @ state.velocity
    for _ in range(200):
        state, exchange = advance(body, state, Damping(0.0, 0.0), 0.0)
    assert exchange.lost == 0
    # every force has its counterforce, to the last bit; the sums round
    assert body.mass @ state.velocity == pytest.approx(before, rel=1e-9)


def test_grips_move_as_the_machine(beam: Problem) -> None:
    run = Run(beam)
    for _, _ in zip(range(400), run.steps(), strict=False):
        pass
    moved = run.state.position - beam.particles.position
    for grip in beam.grips:
        assert grip.mean(moved) == pytest.approx(grip.drive * run.load_line, abs=1e-14)  # round-off of 400 steps
    assert run.load_line > 1e-6


def test_energy_is_accounted_for(beam: Problem) -> None:
    solution = solve(beam)
    assert np.count_nonzero(solution.reached > beam.law.delta_peak) > 5, "bonds must soften"
    # leapfrog conserves energy to second order in the step
    assert solution.energy.error < 1e-3
    assert solution.engine == "reference"
    assert solution.cmod == pytest.approx(beam.stations)


def test_damping_takes_what_it_says(beam: Problem) -> None:
    """Energy of an elastic specimen falls by exactly what damping notes, in the energy that leapfrog keeps."""
    law = type(beam.law)(beam.law.k_n, np.full_like(beam.law.k_n, np.inf), beam.law.delta_max)
    body = body_of(free(beam.with_law(law)))
    state = at_rest_place(body, np.random.default_rng(4).normal(0, 1e-8, (beam.particles.count, 2)))
    damping, noted, energies = Damping(0.05, 0.02), 0.0, []
    for _ in range(300):
        before = state.opening
        state, exchange = advance(body, state, damping, 0.0)
        noted += exchange.lost
        kinetic = 0.5 * np.sum(body.mass[:, None] * state.velocity**2)
        # leapfrog keeps ½ m v² + ½ k δ δ' with the openings of both ends of the step
        energies.append(kinetic + 0.5 * np.sum(law.k_n * before * state.opening) + noted)
    assert energies[-1] == pytest.approx(energies[0], rel=1e-9)  # round-off of 300 steps
    assert noted > 0.1 * energies[0]


def test_tends_to_equilibrium(beam: Problem) -> None:
    """The slower, the nearer; at 1 % asked for within 1 %."""
    limit = equilibrium.solve(beam, tolerance=1e-4)
    at = np.linspace(0.01, 0.14, 60) * MM
    wanted = limit.curve.load_at(at)
    errors = []
    for accuracy in (0.1, 0.01):
        load = solve(replace(beam, accuracy=accuracy)).curve.load_at(at)
        errors.append(np.linalg.norm(load - wanted) / np.linalg.norm(wanted))
    assert errors[1] < min(0.01, errors[0])


def test_the_rate_rule() -> None:
    """Lag above what is wanted slows down ten times as fast as lag below speeds up; never beyond the limits."""
    drive = Drive(rate=1.0, peak=100.0, spent=0.0)
    slower = replace(drive, lag=0.04).factor(wanted=0.01, share=0.01, lowest=0.1, highest=10)
    faster = replace(drive, lag=0.0025).factor(wanted=0.01, share=0.01, lowest=0.1, highest=10)
    assert slower == pytest.approx(0.5**0.1)
    assert faster == pytest.approx(2**0.01)
    assert replace(drive, lag=1.0).factor(0.01, 0.5, lowest=0.9, highest=2) == pytest.approx(0.9)
    assert replace(drive, lag=0.0).factor(0.01, 0.5, lowest=0.9, highest=1.2) == pytest.approx(1.2)


def test_what_motion_and_drag_take_is_a_force_over_the_way() -> None:
    """10 J over 20 steps of 0.5 m at 100 N are 1 N, 1 %; over twice the opening that took this way so far, half."""
    drive, energy = Drive(rate=0.5, peak=100.0, spent=0.0), Energies(0.0, 0.0, 0.0, kinetic=4.0, damping=6.0)
    found = drive.measure(energy, cmod=2.0, load=80.0, line=8.0, steps=20, share=0.1)
    assert found.lag == pytest.approx(0.01)
    assert found.excess == pytest.approx(1.0)
    assert found.error == pytest.approx(ERROR_PER_EXCESS * 1 / 80)
    jumped = replace(drive, opened=2.0).measure(energy, cmod=7.0, load=80.0, line=28.0, steps=20, share=0.1)
    assert jumped.lag == pytest.approx(0.01)
    assert jumped.excess == pytest.approx(0.5)  # 5 m of opening took 20 m of way so far: no jump yet
    leapt = replace(drive, opened=2.0).measure(energy, cmod=12.0, load=80.0, line=48.0, steps=20, share=0.1)
    assert leapt.excess == 0, "a jump is not held"
    assert leapt.excess_squares == pytest.approx(10 * 0.25**2), "but counted: 10 J over 10 m of opening, 40 m of way"
    swung = replace(found, rate=1e-9).measure(replace(energy, kinetic=14.0), 1.5, 80.0, 8.0, steps=20, share=0.1)
    assert swung.excess == pytest.approx(0.9), "fades, and takes nothing in while the mouth swings back"
    assert swung.lag == pytest.approx(10 / (100 * 20e-9)), "but the machine waits"


def test_how_much_lag_is_allowed() -> None:
    """A share of the rms load over CMOD: 1/√3 of the peak at first; less, to a half, where more was spent already."""
    drive = Drive(rate=1.0, peak=100.0, spent=0.0)
    assert drive.allowed(0.01) == pytest.approx(0.01 / np.sqrt(3))
    steady = replace(drive, opened=2.0, load_squares=2.0 * 40**2)
    assert steady.allowed(0.01) == pytest.approx(0.004)
    assert replace(steady, excess_squares=2.0 * 0.6**2).allowed(0.01) == pytest.approx(0.004 / 1.5)
    assert replace(steady, excess_squares=2.0 * 4**2).allowed(0.01) == pytest.approx(0.002)


def test_a_run_that_does_not_arrive_is_refused(beam: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.explicit.loading.LONGEST", 1)
    with pytest.raises(ConvergenceError, match="the gauge stopped at"):
        solve(beam)


def test_expectation_names_steps_and_time(beam: Problem) -> None:
    told = expectation(beam)
    assert "steps of" in told
    assert told.endswith(" s")
    assert {g.role for g in beam.grips} >= {Role.DRIVE, Role.REACT}
