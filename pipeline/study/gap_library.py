"""The library of discrepancies: effect-free virtual tests of engine B, and what the diagnosing model leaves of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.units import MM
from pipeline.execution.progress import Progress, Silent
from pipeline.gap.diagnosis import baseline, weighed
from pipeline.gap.discrepancy import ALL, Discrepancy, Remnant, learn
from pipeline.gap.emulator import Emulator
from pipeline.gap.fit import fit
from pipeline.gap.gate import gate
from pipeline.gap.library import Domain, Entry, written
from pipeline.gap.observation import Observation
from pipeline.inverse.design import Design
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import read_bundle
from pipeline.store.results import prepare_output
from pipeline.store.simulation import SimulationStore
from pipeline.store.start import start_parameters
from pipeline.study.assembly import build_model
from pipeline.study.diagnose_case import ENGINE, Simulator, band_of
from pipeline.study.diagnose_sight import beside, seen
from pipeline.study.engines import engine as engine_of
from pipeline.study.virtual_test import virtual_test

FACTORS = (0.7, 0.95, 1.3)  # of the start, for f_max and delta_max
TURNS = 3  # fits, each with the discrepancy learnt after the one before
QUIET = 1.5  # Σ over noise, below which a direction says what scatter there is beside the waves
NOISE = (0.1e-6, 2e-6)  # m; of one displacement component: the discrepancy itself does not depend on it


@dataclass(frozen=True, eq=False)
class Specimen:
    """One effect-free test and its emulator."""

    name: str
    observation: Observation
    emulator: Emulator


def assumed() -> Discrepancy:
    """What the first fit is weighed with: a few micrometres and per cent in every mode."""
    amplitude = np.full((len(ALL), 3), 3e-6)
    amplitude[-1] = 0.04
    return Discrepancy(amplitude, np.eye(len(ALL)), np.full(3, 1e-6), 0.4e-3, samples=5)


def make_library(
    out: Path,
    file: Path,
    *,
    seeds: Sequence[int],
    geometry: str = "seb",
    radius_mm: float = 1.0,
    temperature: float = 1.0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> str:
    """Make virtual tests, fit them, learn how they differ, write the library; goes on where it stopped.

    Parameters
    ----------
    out : folder for tests and simulations
    file : library to write
    seeds : of the virtual tests, at least four
    geometry, radius_mm : of the tests
    temperature : float; the least that is written, where other effect-free tests ask for more than the left-out ones
    """
    progress = progress or Silent()
    specimens = []
    for seed in seeds:
        progress.stage(f"specimen of seed {seed}")
        folder = out / f"{geometry}-{radius_mm:g}-{seed:04d}"
        specimens.append(one_specimen(folder, seed, geometry, radius_mm, workers, progress))
    radius = radius_mm * MM
    domain = Domain(geometry, (0.75 * radius, 1.5 * radius), _last(specimens), NOISE)
    entry, check = learnt(specimens, domain)
    told = {"version": __version__, "engine": ENGINE, "seeds": list(seeds), "pitch": "1.9 radii, irregular"}
    write_atomically(
        file, written([replace(entry, check=check, temperature=max(temperature, uncalibrated(check)))], told).encode()
    )
    return f"{len(specimens)} specimens; chi-square over degrees of freedom of left-out ones: " + ", ".join(
        f"{mode} {value:.2f}" for mode, value in check.items()
    )


def uncalibrated(check: Mapping[str, float]) -> float:
    """The temperature until blind tests give a better one: what the worst mode of left-out specimens asks for."""
    return max(1.0, *check.values())


def one_specimen(
    folder: Path, seed: int, geometry: str, radius_mm: float, workers: int | None, progress: Progress
) -> Specimen:
    """A virtual test without effects and the diagnosing model's baseline of it."""
    if not (folder / "truth.json").exists():
        virtual_test(folder, seed=seed, geometry=geometry, radius_mm=radius_mm)
    bundle = read_bundle(folder)
    settings = RunSettings(workers=workers)
    model, look = build_model(bundle), seen(bundle)
    store = SimulationStore(prepare_output(folder / "simulations"))
    simulator = Simulator(
        model, look.observation.sight.points, look.abscissae, None, engine_of(ENGINE), store, settings.accuracy,
        settings.workers, progress,
    )  # fmt: skip
    start = start_parameters(bundle)
    band = band_of(look, simulator, start)
    observation = beside(look.observation, band.path)
    design = Design(start, FACTORS, FACTORS)
    provisional = Entry(Domain(geometry, (0.0, 1.0), 1.0, NOISE), assumed(), 1.0, 0, {})
    emulator, _ = baseline(observation, look.abscissae, replace(simulator, band=band), design, provisional)
    return Specimen(folder.name, observation, emulator)


def remnant(specimen: Specimen, entry: Entry) -> Remnant:
    """What the fit of the two parameters leaves of a specimen."""
    observation, data = weighed(specimen.observation, specimen.emulator, entry)
    found = fit(specimen.emulator.candidate([], observation.mask), data)
    left = observation.reading - specimen.emulator.reading(found.parameters)
    return Remnant(replace(observation, reading=left), observation.load_scale)


def learnt(specimens: Sequence[Specimen], domain: Domain) -> tuple[Entry, dict[str, float]]:
    """The discrepancy of all specimens, and χ² over degrees of freedom of each left out in turn, by mode."""
    entry = _iterated(specimens, domain)
    ratios: dict[str, list[float]] = {}
    for k, specimen in enumerate(specimens):
        others = _iterated([*specimens[:k], *specimens[k + 1 :]], domain)
        rest = remnant(specimen, others)
        observation, data = weighed(specimen.observation, specimen.emulator, others)
        left = rest.observation.reading.flat()[observation.mask]
        for mode, ratio in gate(observation, left, data.metric.covariance, others.discrepancy.samples).ratio.items():
            ratios.setdefault(mode, []).append(ratio)
    return entry, {mode: float(np.mean(values)) for mode, values in ratios.items()}


def _iterated(specimens: Sequence[Specimen], domain: Domain) -> Entry:
    entry = Entry(domain, assumed(), 1.0, 0, {})
    for _ in range(TURNS):
        learnt_now = learn([remnant(s, entry) for s in specimens])
        entry = replace(entry, discrepancy=learnt_now)
        entry = replace(entry, discrepancy=replace(learnt_now, white=_white([_heard(s, entry) for s in specimens])))
    return entry


def _heard(specimen: Specimen, entry: Entry) -> np.ndarray:
    """For every stage how many times noise the differences hold where the discrepancy says next to nothing; (3, 3).

    Columns: sum of squares over noise, expected sum, and noise (m²). The directions are those in which Σ is less than
    half again as large as noise.
    """
    rest = remnant(specimen, entry)
    observation, data = weighed(specimen.observation, specimen.emulator, entry)
    mask, p = observation.mask, len(observation.sight.points)
    left, noise = rest.observation.reading.flat()[mask], observation.noise[mask]
    stage = np.concatenate([np.repeat(observation.sight.stage, 2 * p), np.full(observation.sight.cmod.size, -1)])[mask]
    found = np.zeros((3, 3))
    for k in range(3):
        here = stage == k
        root = np.sqrt(noise[here])
        size, shape = np.linalg.eigh(data.metric.part(here).covariance / np.outer(root, root))
        quiet = size < QUIET
        found[k] = np.sum((shape.T @ (left[here] / root))[quiet] ** 2), size[quiet].sum(), np.mean(noise[here])
    return found


def _white(heard: Sequence[np.ndarray]) -> np.ndarray:
    """Independent scatter (3,), m, that makes the quiet directions as loud as they are."""
    square, expected, noise = np.sum(heard, axis=0).T
    excess = square / np.maximum(expected, 1e-9) - 1
    return np.sqrt(np.maximum(excess, 0.0) * noise / len(heard))


def _last(specimens: Sequence[Specimen]) -> float:
    return float(max(s.observation.sight.cmod.max() for s in specimens))
