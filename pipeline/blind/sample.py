"""From a specimen, its phases and its true material to a body of triangles that can be broken, effects included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.blind.body import Body, hanging_together, join
from pipeline.blind.bulk import Bulk, Relaxation, burgers_relaxation, elasticity
from pipeline.blind.calibration import ENERGY, STRENGTH
from pipeline.blind.equilibrium import Setup
from pipeline.blind.machine import machine_of
from pipeline.blind.mesh import Mesh, Zone, triangulate
from pipeline.blind.traction import Branch, Edges
from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.core.specimen import Specimen

PhaseAt = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Points (n, 2) in m → phase (n,) and stone number (n,)."""

HALF_ZONE = 18e-3  # m; edges farther from the notch line do not part (stresses there are looked at after the test)
BEFORE_TIP = 9e-3  # m; of the zone, before the tip
PENALTY = 300.0  # of E over edge length
HURT = 3e-3  # m; damage before the test lies so near to the tip
PLACES = 5  # along each side of a triangle, at which its phase is looked up
VOID = (1.2e-3, 3.0e-3)  # m; diameters of unseen voids


@dataclass(frozen=True)
class Material:
    """The continuum that is broken.

    Parameters
    ----------
    mastic_modulus, aggregate_modulus : float, Pa
    poissons_ratio : float
    plane : "strain" or "stress"
    strength, energy : float, Pa and J/m²; of the mastic
    stone_strength, stone_energy : of the aggregate
    interface_strength, interface_opening : float; of the mastic's strength and last opening
    touching_is_stone : bool; edges between two touching stones are as strong as stone
    shear : float; strength in sliding over that in opening
    creep : (D₁, D₂, η₁, τ₂) of a Burgers fluid in SI, or None
    """

    mastic_modulus: float
    aggregate_modulus: float
    poissons_ratio: float
    plane: str
    strength: float
    energy: float
    stone_strength: float
    stone_energy: float
    interface_strength: float = 0.95
    interface_opening: float = 0.30
    touching_is_stone: bool = False
    shear: float = 1.0
    creep: tuple[float, float, float, float] | None = None


def continuum(f_max: float, delta_max: float, radius: float, thickness: float) -> tuple[float, float]:
    """Strength (Pa) and fracture energy (J/m²) that a hexagonal lattice's f_max (N) and delta_max (m) stand for.

    √3 f_max/(2 r t) and f_max δ_max/(2 r t), for a crack along its close-packed rows.
    """
    traction = f_max / (2 * radius * thickness)
    return float(np.sqrt(3) * traction), traction * delta_max


PHYSICS = frozenset(
    {
        "creep", "modulus", "thermal_gradient", "support_friction", "eccentricity_mm", "notch_length_mm", "tip_damage",
        "softening_shape", "air_voids", "aggregate_strength", "interface_ratio", "shear_strength_ratio",
        "rate_law_per_decade",
    }
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sample:
    """What is to be broken.

    Parameters
    ----------
    specimen : Specimen; as the record says it is
    phase_at : PhaseAt
    material : Material; as the record says it is, at the true strength and energy
    effects : physics effect → value; what the record does not say
    edge : float, m; of the triangles in the zone
    cmod_rate : float, m/s
    """

    specimen: Specimen
    phase_at: PhaseAt
    material: Material
    effects: dict[str, float]
    edge: float
    cmod_rate: float

    def __post_init__(self) -> None:
        unknown = sorted(set(self.effects) - PHYSICS)
        if unknown:
            raise InputError(f"{', '.join(unknown)} is no effect on a specimen: it must be one of {sorted(PHYSICS)}")
        if self.effects.get("creep") and self.material.creep is None:
            raise InputError("an effect of creep needs the creep of the mastic: give the material's Burgers parameters")

    def effect(self, name: str) -> float:
        return self.effects.get(name, 0.0)

    @property
    def true_specimen(self) -> Specimen:
        """With its true notch."""
        specimen: Any = self.specimen
        longer: Specimen = replace(specimen, notch_length=specimen.notch_length + self.effect("notch_length_mm") * 1e-3)
        return longer

    @property
    def true_material(self) -> Material:
        """With its true phases."""
        m = self.material
        return replace(
            m,
            mastic_modulus=m.mastic_modulus * (1 + self.effect("modulus")),
            stone_strength=m.stone_strength * (1 + self.effect("aggregate_strength")),
            stone_energy=m.stone_energy * (1 + self.effect("aggregate_strength")),
            interface_strength=m.interface_strength * (1 + self.effect("interface_ratio")),
            shear=m.shear * (1 + self.effect("shear_strength_ratio")),
        )


def zone_of(specimen: Specimen) -> Zone:
    """Where edges can part: around the ligament."""
    low = max(specimen.tip[1] - BEFORE_TIP, 0.0)
    return Zone(HALF_ZONE, low, specimen.bounds[3])


def setup_of(sample: Sample, rng: np.random.Generator, straight: bool = False) -> Setup:
    """Mesh, edges, bulk and machine of a sample; mesh and voids come from `rng`.

    `straight`: only edges on the notch line can part, with the material's own strength and energy; for comparison.
    """
    specimen, material = sample.true_specimen, sample.true_material
    of_mesh, of_voids = rng.spawn(2)
    zone = zone_of(specimen)
    mesh, slit = triangulate(specimen, zone, sample.edge, of_mesh, straight)
    phase, stone = _phases(mesh, sample.phase_at)
    gone = (phase == Phase.VOID) | _voids(mesh, phase, zone, sample.effect("air_voids"), of_voids)
    mesh, phase, stone = mesh.without(gone), phase[~gone], stone[~gone]
    notch = slit[mesh.points[slit, 1] < specimen.tip[1] + 1e-9]
    firm = hanging_together(mesh, _cut(mesh, notch))
    mesh, phase, stone = mesh.without(~firm), phase[firm], stone[firm]
    cut = _cut(mesh, notch)
    ends, _ = mesh.inner_edges
    middle = mesh.points[ends].mean(axis=1)
    parts = _cut(mesh, slit) if straight else zone.holds(middle) & ~_guarded(sample, specimen, middle)
    body = join(mesh, parts, cut, specimen.thickness)
    edges = _edges(body, specimen, material, phase, stone, sample, straight)
    spent = np.where(
        np.repeat(np.hypot(*(body.middle - specimen.tip).T) <= HURT, 2),
        edges.first + sample.effect("tip_damage") * (edges.last - edges.first),
        0.0,
    )
    return Setup(
        body=body,
        machine=machine_of(body, specimen, sample.effect("eccentricity_mm") * 1e-3),
        edges=edges,
        bulk=_bulk(body, specimen, material, phase, sample, zone),
        spent=spent,
        friction=sample.effect("support_friction"),
        cmod_rate=sample.cmod_rate,
        rate_law=sample.effect("rate_law_per_decade"),
    )


def _guarded(sample: Sample, specimen: Specimen, places: np.ndarray) -> np.ndarray:
    """Which places (n, 2) lie so near to a contact that nothing parts there: what guards a platen moves with it.

    Without it a roller beside the notch line punches triangles out of the surface: sliding knows no pressure.
    """
    _, low, _, high = specimen.bounds
    above = places[:, 1] > (low + high) / 2
    moved = np.where(above, sample.effect("eccentricity_mm") * 1e-3, 0.0)
    return specimen.protected(np.column_stack([places[:, 0] - moved, places[:, 1]]))


def _phases(mesh: Mesh, phase_at: PhaseAt) -> tuple[np.ndarray, np.ndarray]:
    """Phase and stone of every triangle; the image's margin counts as mastic."""
    phase, stone = phase_at(mesh.centre)
    return np.where(phase == Phase.OUTSIDE, np.uint8(Phase.MASTIC), phase), stone


def _stone_share(mesh: Mesh, phase_at: PhaseAt) -> np.ndarray:
    """Share of stone in the solid of every triangle (t,), from places all over it."""
    steps = (np.arange(PLACES) + 1 / 3) / PLACES
    weights = np.array([(a, b, 1 - a - b) for a in steps for b in steps if a + b < 1])
    corner = mesh.points[mesh.corners]
    stone, solid = np.zeros(len(corner)), np.zeros(len(corner))
    for weight in weights:
        phase, _ = phase_at(np.einsum("c,tcx->tx", weight, corner))
        stone += phase == Phase.AGGREGATE
        solid += phase != Phase.VOID
    share: np.ndarray = stone / np.maximum(solid, 1)
    return share


def _cut(mesh: Mesh, slit: np.ndarray) -> np.ndarray:
    """Which inner edges (e,) lie on the notch."""
    place = np.full(len(mesh.points), -10)
    place[slit] = np.arange(slit.size)
    ends, _ = mesh.inner_edges
    a, b = place[ends[:, 0]], place[ends[:, 1]]
    return (a >= 0) & (b >= 0) & (np.abs(a - b) == 1)


def _voids(mesh: Mesh, phase: np.ndarray, zone: Zone, share: float, rng: np.random.Generator) -> np.ndarray:
    """Triangles (t,) of unseen voids: mastic in the zone, in ellipses at random until the share is gone."""
    gone = np.zeros(len(phase), bool)
    open_to = np.flatnonzero(zone.holds(mesh.centre) & (phase == Phase.MASTIC))
    wanted = share * float(mesh.area[zone.holds(mesh.centre)].sum())
    while mesh.area[gone].sum() < wanted:
        middle = mesh.centre[rng.choice(open_to)]
        size, turn, slim = rng.uniform(*VOID) / 2, rng.uniform(0, np.pi), rng.uniform(1.0, 1.6)
        c, s = np.cos(turn), np.sin(turn)
        arm = (mesh.centre[open_to] - middle) @ np.array([[c, -s], [s, c]]) / size
        gone[open_to[np.hypot(arm[:, 0] / np.sqrt(slim), arm[:, 1] * np.sqrt(slim)) < 1]] = True
    return gone


def _warmth(sample: Sample, specimen: Specimen, height: np.ndarray, stone: np.ndarray) -> np.ndarray:
    """What a gradient of temperature makes of modulus and strength at heights (n,), not of stone (n,) bool."""
    _, low, _, high = specimen.bounds
    share = (height - (low + high) / 2) / (high - low)
    return np.where(stone, 1.0, 1 + sample.effect("thermal_gradient") * share)


def _edges(
    body: Body, specimen: Specimen, material: Material, phase: np.ndarray, stone: np.ndarray, sample: Sample,
    straight: bool,
) -> Edges:  # fmt: skip
    """Law of both ends of every edge, from the triangles beside it."""
    one, two = body.sides.T
    stony = (phase[one] == Phase.AGGREGATE) & (phase[two] == Phase.AGGREGATE)
    touching = stony & (stone[one] != stone[two])
    whole = stony & (~touching | material.touching_is_stone)
    mixed = (phase[one] != phase[two]) | (touching & ~whole)
    last = 2 * material.energy / material.strength
    strength = np.where(mixed, material.interface_strength, 1.0) * material.strength
    opening = np.where(mixed, material.interface_opening, 1.0) * last
    strength = np.where(whole, material.stone_strength, strength)
    opening = np.where(whole, 2 * material.stone_energy / material.stone_strength, opening)
    costs = (1.0, 1.0) if straight else (STRENGTH, ENERGY)
    strength = strength * _warmth(sample, specimen, body.middle[:, 1], whole) / costs[0]
    opening = opening * costs[0] / costs[1]
    modulus = np.where(stony, material.aggregate_modulus, material.mastic_modulus)
    return Edges(
        penalty=np.repeat(PENALTY * modulus / sample.edge, 2),
        strength=np.repeat(strength, 2),
        last=np.repeat(opening, 2),
        beta=material.shear,
        branch=Branch(sample.effect("softening_shape")),
    )


def _bulk(body: Body, specimen: Specimen, material: Material, phase: np.ndarray, sample: Sample, zone: Zone) -> Bulk:
    """Triangles; outside the zone unseen voids are too small for the mesh and make it softer (1 − φ)³.

    A triangle that holds stone and mastic has them in series (Reuss 1929): constant strain makes coarse meshes too
    stiff by itself, and the phase of the middle alone would add to that.
    """
    stony = phase == Phase.AGGREGATE
    share = _stone_share(body.mesh, sample.phase_at)
    modulus = 1 / ((1 - share) / material.mastic_modulus + share / material.aggregate_modulus)
    modulus = modulus * _warmth(sample, specimen, body.mesh.centre[:, 1], stony)
    porous = ~zone.holds(body.mesh.centre) & ~stony
    modulus = modulus * np.where(porous, (1 - sample.effect("air_voids")) ** 3, 1.0)
    relaxation = Relaxation()
    if sample.effect("creep"):
        assert material.creep is not None
        d1, d2, eta1, tau2 = material.creep
        share_out = sample.effect("creep")
        relaxation = burgers_relaxation(d1, share_out * d2, eta1 / share_out, tau2)
    return Bulk(elasticity(material.poissons_ratio, material.plane), modulus, ~stony, relaxation)
