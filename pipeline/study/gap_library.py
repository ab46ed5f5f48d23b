"""The library of discrepancies: effect-free virtual tests of engine B, and what the diagnosing model leaves of them."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.units import MM
from pipeline.gap.candidate import Candidate
from pipeline.gap.diagnosis import baseline, with_placements, with_signatures
from pipeline.gap.discrepancy import ALL, KNOTS, Discrepancy
from pipeline.gap.effects import library
from pipeline.gap.emulator import Emulator
from pipeline.gap.fit import fit
from pipeline.gap.learning import Remnant, learn
from pipeline.gap.library import FORMAT, HOLDS, Domain, Entry, parse, written
from pipeline.gap.observation import Observation
from pipeline.gap.selection import Rest, selected
from pipeline.gap.weighing import elsewhere, scatter, weighed
from pipeline.inverse.design import Design
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import read_bundle
from pipeline.store.results import prepare_output
from pipeline.store.simulation import SimulationStore
from pipeline.store.start import start_parameters
from pipeline.study.assembly import build_model
from pipeline.study.batch import KINDS, Batch
from pipeline.study.diagnose_case import ENGINE, Simulator, band_of
from pipeline.study.diagnose_sight import beside, seen
from pipeline.study.engines import engine as engine_of

FACTORS = (0.7, 0.95, 1.3)  # of the start, for f_max and delta_max
TURNS = 3  # fits, each with the discrepancy learnt after the one before
NOISE = (0.1e-6, 2e-6)  # m; of one displacement component: the discrepancy itself does not depend on it
STEP = 1e-3  # of the grid: central differences
# in OUT: what is learnt on the others, for specimens that slide and for those that do not
UNMET = {True: "without-shear.json", False: "with-shear.json"}
FEWEST = 4  # specimens of either half


log = logging.getLogger("pipeline.study")


@dataclass(frozen=True, eq=False)
class Specimen:
    """One effect-free test, its emulator, and its true parameters."""

    name: str
    observation: Observation
    emulator: Emulator
    truth: tuple[float, float]


def assumed() -> Discrepancy:
    """What the first fit is weighed with: a few micrometres and per cent in every mode."""
    amplitude = np.full((len(ALL), KNOTS.size), 3e-6)
    amplitude[-1] = 0.04
    return Discrepancy(amplitude, np.eye(len(ALL)), np.full(3, 1e-6), 0.4e-3, samples=5)


def provisional(geometry: str) -> Entry:
    """The entry before anything is learnt."""
    return Entry(Domain(geometry, (0.0, 1.0), 1.0, NOISE), assumed(), 1.0, 0, {})


def make_library(batch: Batch, file: Path, seeds: Sequence[int], workers: int | None = None) -> str:
    """Make virtual tests, fit them, learn how they differ, write the entry; goes on where it stopped.

    The grids of the specimens are laid twice: with what is assumed before anything is known, and with what was learnt
    after that, as a diagnosis lays them.

    A specimen whose baseline cannot be simulated is left out. Two more entries, each of the specimens whose bonds carry
    shear or do not, are left in the batch's folder for the calibration (`UNMET`).

    Parameters
    ----------
    file : library; an entry of the same geometry and radius is replaced, others stay
    seeds : of the specimens, without gaps; at least `FEWEST` whose bonds carry shear, and as many others

    Raises
    ------
    InputError
        for fewer
    """
    if min(sum(batch.slides(seed) == slides for seed in seeds) for slides in UNMET) < FEWEST:
        raise InputError(
            f"{len(seeds)} specimens are too few to learn from either half of them: take {2 * FEWEST} or more"
        )
    entry, radius, batch = provisional(batch.geometry), batch.radius_mm * MM, batch.with_creep()
    for turn in ("a first", "a second"):
        specimens: dict[int, Specimen] = {}
        for seed in seeds:
            batch.progress.stage(f"specimen of seed {seed}, {turn} time")
            try:
                specimens[seed] = one_specimen(batch, seed, workers, entry)
            except ConvergenceError as error:
                log.warning("the specimen of seed %d is left out: %s", seed, error)
        domain = Domain(batch.geometry, (HOLDS[0] * radius, HOLDS[1] * radius), _last(specimens.values()), NOISE)
        entry = replace(learnt([*specimens.values()], domain), seeds=(seeds[0], seeds[-1]))
    write_entry(file, entry)
    batch.progress.stage("what each half would know of the other")
    for slides, name in UNMET.items():
        others = [specimen for seed, specimen in specimens.items() if batch.slides(seed) != slides]
        half = replace(learnt(others, domain), seeds=entry.seeds)
        write_entry(batch.out / name, half, [kind for kind in KINDS if (kind[1] is not None) != slides])
    return f"{len(specimens)} specimens; chi-square over degrees of freedom of left-out ones: " + ", ".join(
        f"{mode} {value:.2f}" for mode, value in entry.check.items()
    )


def write_entry(file: Path, entry: Entry, learnt_on: Sequence[tuple[float, float | None]] = KINDS) -> None:
    """Put an entry, of so many kinds of networks, into a library, in the place of that of its geometry and radius."""
    old: list[Entry] = []
    if file.exists():
        raw = json.loads(file.read_text("utf-8"))
        old = parse(raw) if raw.get("format") == FORMAT else []
    others = [e for e in old if not same(e.domain, entry.domain)]
    kinds = [f"pitch {pitch:g} radii, {'shear' if ratio else 'no shear'} in bonds" for pitch, ratio in learnt_on]
    told = {"version": __version__, "engine": ENGINE, "networks": "; ".join(kinds)}
    entries = sorted([*others, entry], key=lambda e: (e.domain.geometry, e.domain.radius))
    write_atomically(file, written(entries, told).encode())


def same(one: Domain, two: Domain) -> bool:
    """Whether two entries are of one geometry and radius."""
    return one.geometry == two.geometry and bool(np.allclose(one.radius, two.radius, rtol=1e-6))


def one_specimen(batch: Batch, seed: int, workers: int | None, entry: Entry) -> Specimen:
    """A virtual test without effects and the diagnosing model's baseline of it."""
    folder = batch.folder(seed)
    batch.make(folder, seed)
    truth = json.loads((folder / "truth.json").read_text("utf-8"))
    bundle = read_bundle(folder)
    settings = RunSettings(workers=workers)
    model, look = build_model(bundle), seen(bundle)
    store = SimulationStore(prepare_output(folder / "simulations"))
    simulator = Simulator(
        model, look.observation.sight.points, look.abscissae, None, engine_of(ENGINE), store, settings.accuracy,
        settings.workers, batch.progress,
    )  # fmt: skip
    start = start_parameters(bundle)
    band = band_of(look, simulator, start)
    observation = beside(look.observation, band.path)
    design = Design(start, FACTORS, FACTORS)
    simulator = replace(simulator, band=band)
    emulator, best = baseline(observation, look.abscissae, simulator, design, entry)
    at = emulator.rounded(best.parameters)
    emulator = with_placements(emulator, simulator, at)
    emulator, _ = with_signatures(emulator, simulator, at, list(library()))
    return Specimen(folder.name, observation, emulator, (truth["f_max_n"], truth["delta_max_m"]))


def rest_of(specimen: Specimen, entry: Entry) -> tuple[Rest, np.ndarray]:
    """What the fit of the two parameters leaves of a specimen, and the parameters."""
    observation, data = weighed(specimen.observation, specimen.emulator, entry)
    candidate = specimen.emulator.candidate([], observation.mask)
    found = fit(candidate, data)
    left = observation.reading - specimen.emulator.reading(found.parameters)
    remnant = Remnant(replace(observation, reading=left), observation.load_scale)
    slopes = np.column_stack([_slope(candidate, found.parameters, step) for step in np.diag(STEP * data.width)])
    mask = observation.mask
    rest = Rest(
        remnant, slopes, scatter(specimen.emulator, mask), elsewhere(specimen.emulator, mask),
        specimen.emulator.slopes(mask),
    )  # fmt: skip
    return rest, found.parameters


def _slope(candidate: Candidate, at: np.ndarray, step: np.ndarray) -> np.ndarray:
    nothing = np.zeros(0)
    return (candidate.predict(at + step, nothing) - candidate.predict(at - step, nothing)) / (2 * STEP)


def learnt(specimens: Sequence[Specimen], domain: Domain) -> Entry:
    """The entry of all specimens."""
    entry, found = provisional(domain.geometry), []
    for _ in range(TURNS):
        found = [rest_of(s, entry) for s in specimens]
        entry = replace(entry, discrepancy=learn([rest.remnant for rest, _ in found], 0.5))
    coarse = {n: e.coarseness * domain.learnt_at / MM for n, e in library().items() if e.coarseness}
    chosen = selected([rest for rest, _ in found], coarse)
    off = np.log([parameters / s.truth for s, (_, parameters) in zip(specimens, found, strict=True)])
    return Entry(
        domain,
        chosen.discrepancy,
        1.0,
        0,
        chosen.check,
        chosen.freedom,
        {n: (float(x.mean()), float(x.std(ddof=1))) for n, x in zip(("f_max", "delta_max"), off.T, strict=True)},
        apparent=chosen.apparent,
    )


def _last(specimens: Iterable[Specimen]) -> float:
    return float(max(s.observation.sight.cmod.max() for s in specimens))
