"""Condensation changes nothing but the time: elastic response to round-off, whole tests to the tolerance."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse

from pipeline.core.errors import InputError
from pipeline.core.particles import Bonds
from pipeline.core.problem import Problem
from pipeline.core.units import MM
from pipeline.equilibrium import active, cholesky, far, schur
from pipeline.equilibrium.condensation import CondensedModel, condense
from pipeline.equilibrium.factor import factorise
from pipeline.equilibrium.model import moved_at_once, whole_model
from pipeline.equilibrium.schur import schur_complement
from pipeline.equilibrium.solve import solve
from pipeline.equilibrium.step import Stepper
from pipeline.materials.memory import at_rest
from pipeline.materials.mixed_softening import MixedSoftening

from .specimens import DISK, fracture_test


def laplacian(n: int) -> np.ndarray:
    """Stiffness of a chain of n springs without a support: singular."""
    return 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1) - np.diag(np.eye(n)[0] + np.eye(n)[-1])


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("kept", [[0, 11], [3, 4, 8], [11]])
def test_schur_complement(kept: list[int], compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A chain of unit springs between its kept points: springs in series; loose at one kept point."""
    monkeypatch.setattr(schur, "available", lambda: compiled and cholesky.available())
    chain = laplacian(12)
    inner = np.setdiff1d(np.arange(12), kept)
    inside, across, outer = (
        sparse.csc_array(chain[np.ix_(a, b)]) for a, b in ((inner, inner), (inner, kept), (kept, kept))
    )
    found = schur_complement(inside, across, outer, factorise(inside))
    expected = np.zeros((len(kept), len(kept)))
    for i, (a, b) in enumerate(pairwise(kept)):
        expected[i : i + 2, i : i + 2] += np.array([[1, -1], [-1, 1]]) / (b - a)
    assert found == pytest.approx(expected, abs=1e-12)  # round-off of twelve pivots


@pytest.fixture(scope="module")
def beam() -> Problem:
    """Large enough to be condensed; scatter lets single bonds far from the crack soften."""
    problem = fracture_test(radius=1 * MM, scatter=0.6)
    return replace(problem, cmod_max=0.12 * MM, stations=np.array([0.05, 0.1]) * MM)


@pytest.mark.parametrize("specimen", ["beam", "disk"])  # the machine pulls the disk outside the strip
def test_elastic_response_is_that_of_the_whole(beam: Problem, specimen: str) -> None:
    problem = beam if specimen == "beam" else fracture_test(DISK, 1.5 * MM, scatter=0.2)
    whole = whole_model(problem)
    part = condense(whole, active.strip(problem))
    exact, found = Stepper(whole).elastic(), part.elastic()
    assert part.kept.size < 0.4 * whole.gauge.size
    assert found.load == pytest.approx(exact.load, rel=1e-8)  # round-off of two factorisations, and of tiny motions
    assert found.cmod == pytest.approx(exact.cmod, rel=1e-8)
    assert found.free == pytest.approx(exact.free, abs=1e-8)
    assert found.deformation == pytest.approx(exact.deformation, abs=1e-8)
    assert found.energy == pytest.approx(0.5 * exact.load, rel=1e-8)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_loose_specimen_is_refused(beam: Problem, compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A rigid motion of the whole, and a particle far from the strip that hangs by one bond."""
    monkeypatch.setattr(far, "available", lambda: compiled and cholesky.available())
    end = np.argmax(beam.particles.position[:, 0])
    left = np.ones(beam.bonds.count, bool)
    left[np.flatnonzero(np.any(beam.bonds.pairs == end, axis=1))[1:]] = False
    bonds = Bonds(beam.bonds.pairs[left], beam.bonds.phase[left], beam.bonds.protected[left])
    hanging = replace(beam, bonds=bonds, law=beam.law.of(left))
    for loose in (replace(beam, grips=beam.grips[:1]), hanging):
        with pytest.raises(InputError, match="the elastic stiffness of the specimen is singular"):
            solve(loose)


def test_islands_open_as_in_the_whole(beam: Problem) -> None:
    """Far bonds that lose tension: forces, energy and displacements against a solution of the whole lattice."""
    whole = whole_model(beam)
    random = np.random.default_rng(7)
    part = condense(whole, active.strip(beam))
    far = np.flatnonzero(~part.active)
    # some apart, and all bonds around one particle, which hinder each other
    crowd = np.flatnonzero(np.any(beam.bonds.pairs == beam.bonds.pairs[far[500], 0], axis=1))
    chosen = np.zeros(beam.bonds.count, bool)
    chosen[np.union1d(random.choice(far, 40, replace=False), crowd)] = True
    first = np.arange(chosen.size) < np.flatnonzero(chosen)[20]
    part = part.grown(chosen & first).grown(chosen)
    assert part.active[chosen].all()
    machine, weight = 1e-5, np.where(chosen, 0.01, 1.0) * beam.law.k_n
    solved = {}
    for name, model in (("whole", whole), ("part", part)):
        own = weight if name == "whole" else weight[part.bonds]
        free = np.zeros(model.gauge.size)
        for _ in range(80):  # the preconditioner of a part leaves out how strip and islands act on each other
            internal, load = model.network.pull(own * model.network.opening(free, machine), free, machine)
            free = free - factorise(model.network.stiffness(own, free, machine)).solve(internal)
        solved[name] = (load, free if name == "whole" else part.complete(free, machine))
        if name == "part":
            opening = model.network.opening(free, machine)
            energy = 0.5 * np.sum(own * opening**2) + model.network.energy(free, machine)
            assert energy == pytest.approx(0.5 * load * machine, rel=1e-6)  # YIELD of the crowded bonds
    assert solved["part"][0] == pytest.approx(solved["whole"][0], rel=1e-6)  # as above
    assert solved["part"][1] == pytest.approx(solved["whole"][1], abs=1e-5 * machine)


def test_states_are_carried_to_a_grown_model(beam: Problem) -> None:
    """Without a look at the whole lattice: as if they were expanded to it and reduced again."""
    whole = whole_model(beam)
    part = condense(whole, active.strip(beam))
    random = np.random.default_rng(11)
    far = np.flatnonzero(~part.active)
    chosen = np.zeros(beam.bonds.count, bool)
    chosen[random.choice(far, 30, replace=False)] = True
    part = part.grown(chosen)
    response = Stepper(part).elastic()
    state = moved_at_once(part, response, 1e-6)
    lost = 1e-7 * random.random(part.network.islands.count)  # openings of the first islands beyond the elastic ones
    free = np.append(state.free[: part.kept.size], part.network.islands.compliance @ (beam.law.k_n[0] * lost))
    state = replace(state, free=free, memory=at_rest(part.law).settled(part.network.opening(free, 1e-6), 0.0))
    chosen[random.choice(far, 30, replace=False)] = True
    grown = part.grown(chosen)
    carried, exact = part.carry(state, grown), grown.reduce(part.expand(state))
    scale = np.abs(exact.memory.opening).max()
    assert carried.free == pytest.approx(exact.free, abs=1e-5 * scale)  # YIELD, which a look does not see
    assert carried.memory.opening == pytest.approx(exact.memory.opening, abs=1e-5 * scale)
    assert carried.memory.reached == pytest.approx(exact.memory.reached, abs=1e-5 * scale)


def test_the_result_does_not_depend_on_condensation(beam: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also from a strip so narrow that bonds outside it soften and it must grow."""
    whole = solve(beam, condensed=False, tolerance=1e-5)
    growths = []
    grown = CondensedModel.grown
    monkeypatch.setattr(active, "FEWEST", 0)
    monkeypatch.setattr(CondensedModel, "grown", lambda *a: growths.append(1) or grown(*a))
    for share in (active.STRIP, 0.05):
        monkeypatch.setattr(active.strip, "__defaults__", (share,))
        part = solve(beam, tolerance=1e-5)
        at = np.linspace(0.005, 0.115, 40) * MM
        # residual 1e-5; increments may differ where one was repeated, 1e-4 of the curve
        assert part.curve.load_at(at) == pytest.approx(whole.curve.load_at(at), rel=5e-4)
        assert part.displacement == pytest.approx(whole.displacement, abs=5e-4 * np.abs(whole.displacement).max())
        assert part.energy.error == pytest.approx(whole.energy.error, abs=2e-5)  # measured 1e-5 from the narrow strip
        assert np.array_equal(part.reached > beam.law.delta_peak, whole.reached > beam.law.delta_peak)
    assert len(growths) > 2


def test_sliding_bonds_are_condensed_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the whole lattice: the elastic response to round-off, the test to the tolerance, islands included."""
    problem = fracture_test(radius=1.5 * MM, scatter=0.5)
    own = problem.law
    law = MixedSoftening(
        own.k_n, 0.3 * own.k_n, own.f_max, 0.7 * own.f_max, own.delta_max, 1.2 * own.delta_max, friction=0.4
    )
    problem = replace(problem, law=law, cmod_max=0.15 * MM, stations=np.array([0.06, 0.14]) * MM)
    whole = whole_model(problem)
    part = condense(whole, active.strip(problem))
    exact, found = Stepper(whole).elastic(), Stepper(part).elastic()
    assert found.load == pytest.approx(exact.load, rel=1e-10)  # round-off of two factorisations
    assert part.complete(found.free, 1.0) == pytest.approx(exact.free, abs=1e-10)
    growths, grown = [], CondensedModel.grown
    monkeypatch.setattr(active, "FEWEST", 0)
    monkeypatch.setattr(active.strip, "__defaults__", (0.08,))
    monkeypatch.setattr(CondensedModel, "grown", lambda model, more: growths.append(1) or grown(model, more))
    condensed, full = solve(problem, tolerance=2e-5), solve(problem, condensed=False, tolerance=2e-5)
    assert growths
    at = np.linspace(0.005, 0.145, 40) * MM
    # twice the tolerance, 2e-5 of the strength, in the load of some tens of bonds, and YIELD
    assert condensed.curve.load_at(at) == pytest.approx(full.curve.load_at(at), rel=2e-4)
    assert condensed.displacement == pytest.approx(full.displacement, abs=2e-4 * np.abs(full.displacement).max())
    assert condensed.energy.dissipated == pytest.approx(full.energy.dissipated, rel=1e-3)
    assert condensed.energy.error < 1e-3  # trapezoids over the increments
