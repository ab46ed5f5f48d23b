"""Effects in a virtual test: physics in the irregular network, measurement in what machine and camera write down."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError, UnavailableError
from pipeline.core.field import DisplacementField
from pipeline.core.particles import Phase
from pipeline.core.problem import Problem, Role, Solution
from pipeline.core.specimen import Specimen
from pipeline.core.units import KN, MINUTE, UM
from pipeline.gap.plan import Place, Plan
from pipeline.materials.cohesive import CentralSoftening
from pipeline.materials.mixed_softening import MixedSoftening
from pipeline.materials.rate_softening import RateSoftening
from pipeline.microstructure.attachment import attach_regions
from pipeline.twin.problem import PhaseAt

AnyLaw = TypeVar("AnyLaw", CentralSoftening, MixedSoftening)
VOID_DIAMETER = (1.2e-3, 3.0e-3)  # m, of unseen voids


def refuse_unknown(plan: Plan) -> None:
    """Refuse what the network cannot follow."""
    if plan.strength_per_decade and plan.creep:
        raise UnavailableError("virtual tests with creep and a rate law together are not in this version")
    if plan.creep and plan.spent:
        raise UnavailableError("virtual tests with creep and damage at the tip together are not in this version")
    if plan.specimen.geometry != "seb" and (plan.eccentricity or plan.friction):
        raise UnavailableError("virtual tests with eccentricity or friction are made for seb only")


def with_voids(phase_at: PhaseAt, specimen: Specimen, share: float, rng: np.random.Generator) -> PhaseAt:
    """Phases with round voids in the mastic, their area the given share of the specimen's."""
    if not share:
        return phase_at
    x0, y0, x1, y1 = specimen.bounds
    wanted, centres, radii = share * (x1 - x0) * (y1 - y0), [], []
    while wanted > 0:
        radius = rng.uniform(*VOID_DIAMETER) / 2
        centres.append(rng.uniform((x0, y0), (x1, y1)))
        radii.append(radius)
        wanted -= np.pi * radius**2
    middle, reach = np.array(centres), np.array(radii)

    def seen(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase, stone = phase_at(points)
        hit = np.zeros(len(points), bool)
        for centre, radius in zip(middle, reach, strict=True):
            hit |= np.hypot(*(points - centre).T) < radius
        return np.where(hit & (phase == Phase.MASTIC), np.uint8(Phase.VOID), phase), stone

    return seen


def with_effects(problem: Problem, plan: Plan) -> Problem:
    """The network with the plan's changes of bonds and grips; notch, mixture and voids are in it already."""
    law: Any = problem.law
    place = Place(problem.particles.position[problem.bonds.pairs].mean(axis=1), problem.bonds.phase, plan.specimen)
    factors = plan.factors(place)
    law = law.times(factors.stiffness, factors.strength, factors.opening)
    if plan.spent:
        law = walked(law, np.hypot(*(place.middle - plan.specimen.tip).T) <= plan.spent_radius, plan.spent)
    grips = problem.grips
    if plan.eccentricity:
        regions = [
            replace(r, centre=(plan.eccentricity, r.centre[1]), anchor_x=plan.eccentricity) if r.role != "react" else r
            for r in plan.specimen.grip_regions(problem.particles.radius)
        ]
        grips = attach_regions(regions, problem.particles)
    if plan.friction:
        grips = tuple(
            replace(g, direction=_leaning(g.name, plan.friction)) if g.role is Role.REACT else g for g in grips
        )
    if plan.strength_per_decade:
        law = _at_its_rate(law, plan.strength_per_decade)
    return replace(problem, law=law, grips=grips)


def _at_its_rate(law: CentralSoftening | MixedSoftening, per_decade: float) -> RateSoftening:
    """The law with strengths that depend on the rate of opening; whoever solves the problem must know that law."""
    if isinstance(law, MixedSoftening):
        raise UnavailableError(
            "a rate law of bonds that carry shear is not in this version: set poissons_ratio to its limit"
        )
    return RateSoftening(law, per_decade)


def _leaning(name: str, friction: float) -> np.ndarray:
    """The unit vector of a support's force, which friction turns towards mid-span."""
    turn = np.arctan(friction) * (1 if name == "left" else -1)
    return np.array([np.sin(turn), np.cos(turn)])


def walked(law: AnyLaw, near: np.ndarray, spent: float) -> AnyLaw:
    """Bonds, those `near` having walked a share of their straight softening branches, opening and sliding alike."""
    if law.softening.left(np.array([0.5]))[0] != 0.5:
        raise UnavailableError("damage at the tip together with another softening shape is not in this version")
    hurt = near & np.isfinite(law.f_max)
    k_n, f_max = _on_branch(law.k_n, law.f_max, law.delta_max, hurt, spent)
    if isinstance(law, CentralSoftening):
        return replace(law, k_n=k_n, f_max=f_max)
    k_s, f_shear = _on_branch(law.k_s, law.f_shear, law.delta_shear, hurt, spent)
    return replace(law, k_n=k_n, f_max=f_max, k_s=k_s, f_shear=f_shear)


def _on_branch(
    stiffness: np.ndarray, strength: np.ndarray, end: np.ndarray, hurt: np.ndarray, spent: float
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and strength of a branch whose share `spent` lies behind it."""
    peak = np.where(hurt, strength, 0.0) / stiffness
    left = np.where(hurt, (1 - spent) * strength, strength)
    reached = np.where(hurt, peak + spent * (np.where(hurt, end, 0.0) - peak), 1.0)
    return np.where(hurt, left / reached, stiffness), left


def put_down(problem: Problem, solution: Solution, plan: Plan) -> Solution:
    """Displacements with the supports at their height, from which leaning forces have lifted them."""
    if not plan.friction:
        return solution
    moved = solution.displacement.copy()
    left, right = (next(g for g in problem.grips if g.name == name) for name in ("left", "right"))
    span = problem.specimen.contacts()["right"][0] - problem.specimen.contacts()["left"][0]  # type: ignore[attr-defined]
    for frame in moved:
        rise = [float(g.weight @ frame[g.index, 1]) for g in (left, right)]
        slope = (rise[1] - rise[0]) / span
        frame[:, 1] -= 0.5 * sum(rise) + slope * problem.particles.position[:, 0]
        frame[:, 0] += slope * (problem.particles.position[:, 1] - problem.specimen.bounds[3])
    return replace(solution, displacement=moved)


@dataclass(frozen=True, eq=False)
class Record:
    """What is written down, and what is needed to spoil it.

    Parameters
    ----------
    curve : LoadCurve
    field : DisplacementField, counted by time
    specimen : Specimen
    heading : float, rad; direction of a drift
    """

    curve: LoadCurve
    field: DisplacementField
    specimen: Specimen
    heading: float

    @property
    def middle(self) -> np.ndarray:
        """Centre of the view (2,), m."""
        return (self.field.points.min(axis=0) + self.field.points.max(axis=0)) / 2

    @property
    def corner(self) -> float:
        """Distance (m) from there to a corner of the view."""
        return float(np.hypot(*np.ptp(self.field.points, axis=0)) / 2)

    def moved(self, by: np.ndarray) -> Record:
        """With displacements (frames, n, 2), m, added to the fields."""
        return replace(self, field=replace(self.field, displacement=self.field.displacement + by))


def _fixture(record: Record, value: float) -> Record:
    load = np.interp(record.field.abscissa, record.curve.time, record.curve.load)
    way = np.array([0.0, -1.0]) if record.specimen.geometry == "seb" else np.array([1.0, 0.0])
    return record.moved(value * UM / KN * load[:, None, None] * way)


def _late(record: Record, value: float) -> Record:
    return replace(record, field=replace(record.field, abscissa=record.field.abscissa + value))


def _gauge(record: Record, value: float) -> Record:
    return replace(record, curve=replace(record.curve, cmod=record.curve.cmod * (1 + value)))


def _nearer(record: Record, value: float) -> Record:
    cmod = np.interp(record.field.abscissa, record.curve.time, record.curve.cmod)
    growth = value * cmod / record.curve.cmod.max()
    return record.moved(growth[:, None, None] * (record.field.points + record.field.displacement - record.middle))


def _lens(record: Record, value: float) -> Record:
    def seen(position: np.ndarray) -> np.ndarray:
        arm = (position - record.middle) / record.corner
        return value * np.sum(arm**2, axis=-1, keepdims=True) * (position - record.middle)

    here = record.field.points
    return record.moved(seen(here + record.field.displacement) - seen(here))


def _drift(record: Record, value: float) -> Record:
    passed = record.field.abscissa - record.field.abscissa[0]
    way = np.array([np.cos(record.heading), np.sin(record.heading)])
    return record.moved(value * UM / MINUTE * passed[:, None, None] * way)


def _cell(record: Record, value: float) -> Record:
    return replace(record, curve=replace(record.curve, load=record.curve.load * (1 + value)))


SPOILED: Mapping[str, Callable[[Record, float], Record]] = {
    "fixture_compliance_um_per_kn": _fixture,
    "magnification": _nearer,
    "lens_distortion": _lens,
    "drift_um_per_min": _drift,
    "load_gain": _cell,
    "cmod_gain": _gauge,
    "sync_offset_s": _late,
}  # in the order in which they act: what the camera sees, what the cells read, what the clock says


def spoiled(record: Record, effects: Mapping[str, float]) -> Record:
    """The record with measurement effects in it.

    Raises
    ------
    InputError
        for an effect that is none of the measurement
    """
    unknown = sorted(set(effects) - set(SPOILED))
    if unknown:
        raise InputError(f"{', '.join(unknown)} does not act on a record")
    for name, act in SPOILED.items():
        if name in effects:
            record = act(record, effects[name])
    return record
