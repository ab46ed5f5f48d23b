"""A test with effects in it, on the hexagonal lattice: from the plan of a test to a Problem for any engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.core.errors import InputError, UnavailableError
from pipeline.core.particles import Bonds, Particles, Phase
from pipeline.core.problem import Grip, Problem, Role, Solution
from pipeline.core.specimen import GripRegion, Specimen
from pipeline.gap.effect import PhysicsEffect
from pipeline.gap.effects import checked, effect
from pipeline.gap.plan import Place, Plan
from pipeline.materials.cohesive import CentralSoftening, LinearSoftening
from pipeline.materials.creeping_mixture import creeping_law
from pipeline.materials.creeping_softening import CreepingSoftening
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.rate_softening import RateSoftening
from pipeline.microstructure.attachment import attach_regions
from pipeline.microstructure.packing import hexagonal_packing
from pipeline.microstructure.phases import lay_phases
from pipeline.study.assembly import Model, test_clock

WEAKEST = 1e-6  # of K^n and f_max, left to a bond that is cut
STUBBORN = 2.5  # makes the compliance of a beam rise evenly while a bond goes (measured on SE(B), r = 2 mm)
SOFT = (Phase.MASTIC, Phase.INTERFACE, Phase.TOUCHING)


@dataclass(frozen=True, eq=False)
class Band:
    """Where bonds may be damaged: a strip around a crack path.

    A model whose crack is held to the observed path answers smoothly to small changes; one that finds its own jumps.
    Beyond the end of the path the strip goes on along the notch line's direction and widens.

    Parameters
    ----------
    path : (k, 2) array, m; from the notch tip on, y increasing
    half : float, m; half its width
    """

    path: np.ndarray
    half: float

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 2) lie in it; (n,) bool."""
        x, y = points.T
        centre = np.interp(y, self.path[:, 1], self.path[:, 0])
        beyond = np.maximum(y - self.path[-1, 1], 0.0)
        before = np.maximum(self.path[0, 1] - y, 0.0)
        return (np.abs(x - centre) <= self.half + 0.5 * beyond) & (before <= self.half)


def planned(specimen: Specimen, mixture: Any, effects: Mapping[str, float]) -> Plan:
    """The plan of a test with physics effects in it; measurement effects are left to the reading.

    Parameters
    ----------
    specimen : Specimen
    mixture : Mixture
    effects : name → value
    """
    plan = Plan(specimen, mixture)
    for name in sorted(effects):
        one = effect(name)
        if isinstance(one, PhysicsEffect):
            plan = one.change(effects[name], plan)
    return plan


def physics_effects(given: Sequence[tuple[str, float]] | None) -> dict[str, float]:
    """Physics effects by name, as they are asked for in a simulation.

    Raises
    ------
    InputError
        for an unknown or implausible one, one given twice, and those of the measurement: a simulation has none
    """
    found: dict[str, float] = {}
    for name, value in given or ():
        if effect(name).kind != "physics":
            raise InputError(f"{name} acts on what is measured, and a simulation measures nothing: use virtual-test")
        if name in found:
            raise InputError(f"{name} is given twice: give it once, with its whole value")
        found[name] = checked(name, value)
    return found


def lattice_problem(model: Model, plan: Plan, problem: Problem, f_max: float, delta_max: float) -> Problem:
    """The lattice's test with a plan's changes.

    Parameters
    ----------
    model : Model; of the bundle as it is
    plan : Plan
    problem : Problem of the model at these parameters, whose stations and end are kept
    f_max, delta_max : float, N per bond of the bundle's lattice, m

    Raises
    ------
    UnavailableError
        for changes that this lattice cannot follow
    InputError
        for changes without effect, or impossible ones
    """
    _refuse(plan)
    bonds, particles, cut = model.bonds, model.particles, np.ones(model.bonds.count)
    if plan.specimen != model.bundle.specimen:
        particles, bonds, cut = _other_notch(model, plan.specimen)
    law = _law(model, plan, bonds, f_max * model.force_scale, delta_max)
    place = Place(particles.position[bonds.pairs].mean(axis=1), bonds.phase, plan.specimen)
    factors = plan.factors(place)
    soft = np.isin(bonds.phase, SOFT)
    solid = np.where(soft, 1 - plan.void_share, 1.0)
    stiffness = factors.stiffness * solid**3 * cut  # E ∝ (1 − φ)³: 1 − 3φ for few round voids (Day et al. 1992)
    strength = factors.strength * solid * cut  # what is left of a section
    changed = law.times(stiffness, strength, factors.opening)
    if plan.spent:
        changed = _spent(changed, plan, place.middle)
    rated = _at_its_rate(changed, plan)
    grips = _grips(model, plan, particles)
    clock = test_clock(model.bundle) if plan.creep else None
    return replace(
        problem, specimen=plan.specimen, particles=particles, bonds=bonds, law=rated, grips=grips, clock=clock
    )


def _law(
    model: Model, plan: Plan, bonds: Bonds, f_max: float, delta_max: float
) -> CentralSoftening | MixedSoftening | CreepingSoftening:
    """The law of every bond of the plan's mixture; its mastic creeps, in proportion, as that of the creep test."""
    mixture, thickness = plan.mixture, plan.specimen.thickness
    if not plan.creep:
        return mixture.law(bonds, thickness, f_max, delta_max)
    mastic = model.burgers.like(mixture.mastic_modulus, plan.creep)
    return creeping_law(mixture, mastic, bonds, thickness, f_max, delta_max)


def _at_its_rate(
    law: CentralSoftening | MixedSoftening | CreepingSoftening, plan: Plan
) -> CentralSoftening | MixedSoftening | CreepingSoftening | RateSoftening:
    """The law with strengths that depend on the rate of opening."""
    if not plan.strength_per_decade:
        return law
    if not isinstance(law, CentralSoftening):
        raise UnavailableError(
            "strength that rises with the rate of opening is not simulated for bonds that creep or carry shear"
        )
    return RateSoftening(law, plan.strength_per_decade)


def held_to(problem: Problem, band: Band) -> Problem:
    """The same test; bonds outside the band take no damage."""
    law = problem.law
    assert isinstance(law, CentralSoftening | MixedSoftening | CreepingSoftening | RateSoftening)
    inside = band.holds(problem.particles.position[problem.bonds.pairs].mean(axis=1))
    return problem.with_law(law.spared(~inside))


def _refuse(plan: Plan) -> None:
    if plan.specimen.geometry != "seb" and (plan.eccentricity or plan.friction):
        raise UnavailableError("eccentricity and friction are simulated for seb only")


def _other_notch(model: Model, specimen: Specimen) -> tuple[Particles, Bonds, np.ndarray]:
    """Particles, bonds and what is left of each bond (m,) with a notch of another length.

    A lattice cuts whole bonds. So that the effect is continuous, and none at the nominal length, the n-th bond ahead
    of the nominal tip is weakened as the true tip passes from n − 1 to n of the bonds' distances: with half its
    stiffness left a bond at a tip still does most of its work, so it falls faster than in proportion.
    """
    nominal: Any = model.bundle.specimen
    longer = specimen.notch_length - nominal.notch_length
    if nominal.notch_width > 0:
        particles, bonds = _laid(model, specimen)
        return particles, bonds, np.ones(bonds.count)
    step = _pitch(model)
    shortest: Any = replace(nominal, notch_length=nominal.notch_length + min(longer, 0.0) - step)
    particles, bonds = _laid(model, shortest)
    height = _crossing(particles, bonds)
    ahead = np.sort(np.unique(np.round(height[height >= nominal.notch_length], 9)))
    if not ahead.size:
        raise InputError(f"a notch of {specimen.notch_length * 1e3:g} mm leaves no ligament")
    number = np.rint((height - ahead[0]) / step)
    gone = np.where(np.isfinite(height), np.clip(longer / step - number, 0.0, 1.0), 0.0)
    left = np.maximum((1 - gone) / (1 + STUBBORN * gone), WEAKEST)
    return particles, bonds, left


def _laid(model: Model, specimen: Specimen) -> tuple[Particles, Bonds]:
    packing = hexagonal_packing(specimen, model.particles.radius, model.bundle.model.lattice_angle)
    particles, bonds, _ = lay_phases(specimen, packing, model.phase_map)
    if particles.count != model.particles.count:
        raise UnavailableError("another notch changes which particles hold to the specimen: choose another radius")
    return particles, bonds


def _pitch(model: Model) -> float:
    """Mean distance (m) along the notch line of the bonds that cross it."""
    height = _crossing(model.particles, model.bonds)
    crossed = np.unique(np.round(height[np.isfinite(height)], 9))
    return float(np.mean(np.diff(crossed)))


def _crossing(particles: Particles, bonds: Bonds) -> np.ndarray:
    """Height (m,), m, at which bonds cross the notch line; NaN where they do not."""
    one, two = (particles.position[bonds.pairs[:, k]] for k in (0, 1))
    crosses = (one[:, 0] >= 0) != (two[:, 0] >= 0)
    run = np.where(crosses, two[:, 0] - one[:, 0], 1.0)
    return np.where(crosses, one[:, 1] - one[:, 0] / run * (two[:, 1] - one[:, 1]), np.nan)


def _spent(
    law: CentralSoftening | MixedSoftening | CreepingSoftening, plan: Plan, middle: np.ndarray
) -> LinearSoftening:
    """Bonds near the tip with a part of their softening behind them: the rest of the straight branch is kept."""
    if not isinstance(law, LinearSoftening):
        raise UnavailableError(
            "damage at the tip is simulated with linear softening only, and with bonds that carry no shear "
            "(poissons_ratio at its limit)"
        )
    near = np.hypot(*(middle - plan.specimen.tip).T) <= plan.spent_radius
    near &= np.isfinite(law.f_max)
    reached = law.delta_peak + plan.spent * (np.where(near, law.delta_max, 0.0) - np.where(near, law.delta_peak, 0.0))
    strength = np.where(near, (1 - plan.spent) * np.where(near, law.f_max, 0.0), law.f_max)
    with np.errstate(invalid="ignore"):
        stiffness = np.where(near, strength / np.where(near, reached, 1.0), law.k_n)
    return replace(law, k_n=stiffness, f_max=strength)


def _grips(model: Model, plan: Plan, particles: Particles) -> tuple[Grip, ...]:
    """Grips with the load beside the notch line, and supports that rub."""
    if not (plan.eccentricity or plan.friction):
        return model.grips
    regions = plan.specimen.grip_regions(particles.radius)
    return tuple(_rubbing(g, plan.friction) for g in attach_regions([_moved(r, plan) for r in regions], particles))


def _moved(region: GripRegion, plan: Plan) -> GripRegion:
    if region.role == Role.REACT:
        return region
    return replace(region, centre=(plan.eccentricity, region.centre[1]), anchor_x=plan.eccentricity)


def _rubbing(grip: Grip, friction: float) -> Grip:
    """A support in full slip: its force leans inwards by the friction angle.

    Its motion is held in that direction too, which lifts the specimen as it slides; `settled` takes that off.
    """
    if grip.role is not Role.REACT:
        return grip
    inward = 1.0 if grip.name == "left" else -1.0
    direction = np.array([inward * friction, 1.0])
    return replace(grip, direction=direction / np.linalg.norm(direction))


def settled(problem: Problem, solution: Solution) -> Solution:
    """The same solution on supports that do not rise: moved as a whole so that their mean height stays.

    Forces fix displacements up to a rigid motion. So leaning supports, put back to their height by one, give exactly
    the equilibrium of a specimen whose supports slide with friction.
    """
    react = [g for g in problem.grips if g.role is Role.REACT]
    if all(abs(g.direction[0]) < 1e-12 for g in react) or problem.specimen.geometry != "seb":
        return solution
    position, moved = problem.particles.position, np.array(solution.displacement)
    places = np.array([g.weight @ position[g.index] for g in react])
    heights = np.array([moved[:, g.index, 1] @ g.weight for g in react])
    turn = (heights[1] - heights[0]) / (places[1, 0] - places[0, 0])
    [pivot] = [g.weight @ position[g.index] for g in problem.grips if g.role is Role.GUIDE]
    arm = position - places[0]
    moved[..., 1] -= heights[0][:, None] + turn[:, None] * arm[:, 0]
    moved[..., 0] += turn[:, None] * (position[:, 1] - pivot[1])
    return replace(solution, displacement=moved)
