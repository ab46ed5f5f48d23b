"""What engine C makes of a beam: against a straight crack, against the lattice, and as its edges get shorter."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.blind.equilibrium import solve as break_triangles
from pipeline.blind.sample import PhaseAt, Sample, setup_of
from pipeline.core.particles import Phase
from pipeline.core.units import MM
from pipeline.equilibrium.solve import solve as find_equilibria
from pipeline.store.bundle import read_bundle
from pipeline.store.new import Contents, write_bundle
from pipeline.study.assembly import build_model
from pipeline.study.blind_check.cases import SIZES
from pipeline.study.blind_check.specimens import Drawn, draw, material_of

CMOD_MAX = 0.55 * MM
AT = (0.1, 0.2, 0.45)  # mm of CMOD, in the tables
HEAD = "| what | peak, N | at a CMOD of, µm | " + " | ".join(f"load at {c} mm" for c in AT) + " | ∫P dCMOD, J | s |"


def beam(seed: int, edge_mm: float, stones: bool) -> tuple[Drawn, Sample]:
    """The first beam of a small check of this seed, and what engine C breaks; without its stones where asked."""
    size = SIZES["small"]
    drawn = draw("seb", size, np.random.default_rng([seed, 1]).spawn(1)[0])
    phase_at: PhaseAt = drawn.phase_map.at if stones else _mastic
    rate = drawn.experiment.loading.cmod_rate
    return drawn, Sample(drawn.specimen, phase_at, material_of(drawn), {}, edge_mm * MM, rate)


def _mastic(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.full(len(points), np.uint8(Phase.MASTIC)), np.zeros(len(points), np.int32)


def rows(
    seed: int, stones: bool, radii_mm: Sequence[float], edges_mm: Sequence[float], meshes: Sequence[int],
    shear: float | None = None,
) -> Iterator[str]:  # fmt: skip
    """A table: the lattice at several radii, engine C's straight crack (without stones) and its free cracks.

    `shear`: strength in sliding over that in opening, instead of the lattice's own.
    """
    yield HEAD
    yield "|---|" + "---|" * (HEAD.count("|") - 2)
    for radius in radii_mm:
        yield _line(f"lattice, {radius:g} mm", *_lattice(beam(seed, 2.0, stones)[0], radius, stones))
    for edge in edges_mm:
        sample = beam(seed, edge, stones)[1]
        if shear is not None:
            sample = replace(sample, material=replace(sample.material, shear=shear))
        if not stones:
            yield _line(f"engine C, {edge:g} mm, one row of edges", *_triangles(sample, 0, straight=True))
        for mesh in meshes:
            yield _line(f"engine C, {edge:g} mm, mesh {mesh}", *_triangles(sample, mesh))


def _lattice(drawn: Drawn, radius_mm: float, stones: bool) -> tuple[np.ndarray, np.ndarray, float]:
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        write_bundle(Path(folder), drawn.experiment, Contents(labels=drawn.labels) if stones else Contents())
        model = build_model(read_bundle(Path(folder)), radius_mm * MM)
        found = find_equilibria(model.problem(drawn.f_max, drawn.delta_max, cmod_max=CMOD_MAX))
    return found.curve.cmod, found.curve.load, time.process_time() - began


def _triangles(sample: Sample, mesh: int, straight: bool = False) -> tuple[np.ndarray, np.ndarray, float]:
    began = time.process_time()
    path = break_triangles(setup_of(sample, np.random.default_rng([7, mesh]), straight), 1.002 * CMOD_MAX)
    return path.cmod, path.load, time.process_time() - began


def _line(name: str, cmod: np.ndarray, load: np.ndarray, seconds: float) -> str:
    inside = np.append(cmod[cmod < CMOD_MAX], CMOD_MAX)
    curve = np.interp(inside, cmod, load)
    at = " | ".join(f"{np.interp(c * MM, cmod, load):.0f}" for c in AT)
    peak = int(np.argmax(load))
    return (
        f"| {name} | {load[peak]:.0f} | {cmod[peak] * 1e6:.0f} | {at} | {np.trapezoid(curve, inside):.3f} | "
        f"{seconds:.0f} |"
    )
