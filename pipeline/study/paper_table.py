"""The two tests of Hill et al. 2017 side by side at the parameters that the paper found.

The paper states no span of its beam, no modulus of the mixture and no share of stones of the specimens: they are
varied here, and the table says where both of its differences (peak load and fracture energy of SE(B) over DC(T)) would
be met.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.problem import Problem, Solution
from pipeline.core.specimen import ligament_area
from pipeline.core.units import KN, MM
from pipeline.core.work_of_fracture import cmod_fracture_energy
from pipeline.execution.progress import Progress, Silent
from pipeline.execution.simulations import run_all
from pipeline.microstructure.gradation import Grading
from pipeline.store.bundle import read_bundle
from pipeline.store.experiment import Experiment
from pipeline.store.new import write_bundle
from pipeline.store.problem_key import problem_key
from pipeline.store.simulation import SimulationStore
from pipeline.study.assembly import Model, build_model
from pipeline.study.engines import engine as engine_of
from pipeline.study.virtual_test import with_section

PUBLISHED = {"seb": (71.0, 1.2e-4), "dct": (85.0, 1.3e-4)}  # N at r = 0.3 mm and the test's thickness, m; elastic fits
LOAD_DIFFERENCE, ENERGY_DIFFERENCE = 1.13 * KN, 156.4  # SE(B) over DC(T): N, J/m²; p. 10 of the paper
CMOD_AT_PEAK_MM = {"seb": 0.05, "dct": 0.10}  # read off Fig. 9
SPECIMENS: dict[str, dict[str, Any]] = {
    "seb": {"thickness_mm": 40.0, "depth_mm": 60.0, "notch_length_mm": 15.0},
    "dct": {"thickness_mm": 50.0},
}
END_MM = {"seb": 1.0, "dct": 1.5}
RATE_MM_PER_MIN = {"seb": 0.5, "dct": 1.0}
LONGEST_MM = 150.0
OVERHANG_MM = 3.5  # of the beam beyond each support


@dataclass(frozen=True)
class Unknowns:
    """What the paper does not state.

    Parameters
    ----------
    modulus_gpa : float; of the mastic
    share : float; of stones of at least 2.36 mm in the section
    span_mm : float; of SE(B)
    aggregate_gpa : float; modulus of the stones
    """

    modulus_gpa: float = 10.0
    share: float = 0.45
    span_mm: float = 110.0
    aggregate_gpa: float = 50.0


@dataclass(frozen=True)
class Reading:
    """One simulated test: N, mm, J/m², and whether the load fell to the 0.1 kN at which D7313 ends."""

    peak: float
    cmod_at_peak: float
    energy: float
    ended: bool

    @staticmethod
    def of(curve: LoadCurve, area: float) -> Reading:
        cmod, load = curve.peak()
        found = cmod_fracture_energy(curve, area)
        return Reading(load, cmod / MM, found.energy, found.complete)


@dataclass(frozen=True)
class Row:
    """Both tests at one set of unknowns, one entry a section."""

    unknowns: Unknowns
    seb: tuple[Reading, ...]
    dct: tuple[Reading, ...]

    def differences(self) -> tuple[np.ndarray, np.ndarray]:
        """SE(B) minus DC(T) of every section: peak (N) and fracture energy (J/m²)."""
        pairs = list(zip(self.seb, self.dct, strict=True))
        return np.array([a.peak - b.peak for a, b in pairs]), np.array([a.energy - b.energy for a, b in pairs])


def paper_rows(
    folder: Path,
    unknowns: Sequence[Unknowns],
    seeds: Iterable[int],
    *,
    radius_mm: float = 0.6,
    engine: str = "lammps",
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Simulate both tests at the published parameters for every set of unknowns and section; a second call goes on.

    Parameters
    ----------
    folder : where bundles and simulations are kept
    unknowns : sets of what the paper does not state
    seeds : of the sections
    radius_mm : of the particles; f_max is scaled with it
    """
    sections = tuple(seeds)
    store = SimulationStore(folder / "simulations")
    chosen = engine_of(engine)
    model = cache(lambda geometry, known, seed: _model(folder, geometry, known, seed, radius_mm))
    problems = {
        (geometry, own, seed): _problem(model(geometry, own, seed), geometry)
        for known in unknowns
        for geometry, own in (("seb", known), ("dct", _without_span(known)))
        for seed in sections
    }
    keys = {case: problem_key(problem, chosen.label) for case, problem in problems.items()}
    wanted = {key: problems[case] for case, key in keys.items()}
    run_all(chosen.solve, wanted, store, workers=workers, progress=progress or Silent())
    read = _reader(store.get, problems, keys)
    return [
        Row(
            known,
            tuple(read("seb", known, seed) for seed in sections),
            tuple(read("dct", _without_span(known), seed) for seed in sections),
        )
        for known in unknowns
    ]


def paper_table(rows: Sequence[Row]) -> str:
    """Rows as a Markdown table: medians over the sections, and the range of the two differences."""
    lines = [
        "| E mastic | share | span | peak SE(B) | DC(T) | CMOD at peak SE(B) | DC(T) | G_f SE(B) | DC(T) "
        "| peak, SE(B) − DC(T) | G_f, SE(B) − DC(T) |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        known, (load, energy) = row.unknowns, row.differences()
        medians = [
            f"{np.median([getattr(r, name) for r in test]):{form}}{unit}"
            for name, form, unit in (("peak", ".0f", " N"), ("cmod_at_peak", ".3f", " mm"), ("energy", ".0f", " J/m²"))
            for test in (row.seb, row.dct)
        ]
        lines.append(
            f"| {known.modulus_gpa:g} GPa | {known.share:g} | {known.span_mm:g} mm | {' | '.join(medians)} | "
            f"{_spread(load / KN, '+.2f')} kN | {_spread(energy, '+.0f')} J/m² |"
        )
    lines.append(
        f"| paper | | | | | {CMOD_AT_PEAK_MM['seb']} mm | {CMOD_AT_PEAK_MM['dct']} mm | | | "
        f"{LOAD_DIFFERENCE / KN:+.2f} kN | {ENERGY_DIFFERENCE:+.1f} J/m² |"
    )
    return "\n".join(lines) + "\n"


def spans_that_match(rows: Sequence[Row]) -> str:
    """At which span each of the two differences would be the paper's, by straight lines between the rows' medians."""
    told = []
    for base in dict.fromkeys(replace(row.unknowns, span_mm=0.0) for row in rows):
        group = sorted(
            (row for row in rows if replace(row.unknowns, span_mm=0.0) == base), key=lambda row: row.unknowns.span_mm
        )
        if len(group) < 2:
            continue
        spans = np.array([row.unknowns.span_mm for row in group])
        medians = np.array([[np.median(d) for d in row.differences()] for row in group])
        load, energy = _met(spans, medians[:, 0], LOAD_DIFFERENCE), _met(spans, medians[:, 1], ENERGY_DIFFERENCE)
        known = f"E = {base.modulus_gpa:g} GPa, share {base.share:g}"
        told.append(f"{known}: the load's difference is met at {load}, the energy's at {energy}")
    return "\n".join(told) + "\n"


def _met(spans: np.ndarray, values: np.ndarray, wanted: float) -> str:
    """Where a piecewise straight line takes a value, in words."""
    for (a, x), (b, y) in pairwise(zip(spans, values, strict=True)):
        if min(x, y) <= wanted <= max(x, y) and x != y:
            return f"a span of {a + (b - a) * (wanted - x) / (y - x):.0f} mm"
    return f"no span from {spans[0]:g} to {spans[-1]:g} mm"


def _reader(
    get: Callable[[str], Solution | None], problems: dict[Any, Problem], keys: dict[Any, str]
) -> Callable[[str, Unknowns, int], Reading]:
    def read(geometry: str, known: Unknowns, seed: int) -> Reading:
        case = (geometry, known, seed)
        solution = get(keys[case])
        assert solution is not None
        return Reading.of(solution.curve, ligament_area(problems[case].specimen))

    return read


def _without_span(known: Unknowns) -> Unknowns:
    return replace(known, span_mm=0.0)


def _model(folder: Path, geometry: str, known: Unknowns, seed: int, radius_mm: float) -> Model:
    """The specimen of one section; its bundle is written where it is not there yet."""
    name = f"{geometry}-{known.modulus_gpa:g}-{known.aggregate_gpa:g}-{known.share:g}-{known.span_mm:g}-{seed}"
    if not (folder / name / "experiment.toml").is_file():
        grading = Grading(area_fraction=known.share)
        largest = _experiment(name, geometry, replace(known, span_mm=LONGEST_MM), radius_mm)
        framed, contents = with_section(largest, np.random.default_rng(seed), grading)  # one section for all spans
        raw = _experiment(name, geometry, known, radius_mm).model_dump(exclude_none=True)
        raw["specimen"]["image"] = framed.model_dump(exclude_none=True)["specimen"]["image"]
        write_bundle(folder / name, Experiment.model_validate(raw), contents)
    return build_model(read_bundle(folder / name))


def _experiment(name: str, geometry: str, known: Unknowns, radius_mm: float) -> Experiment:
    """The settings of a test at the published parameters, without a section."""
    specimen = {"geometry": geometry, **SPECIMENS[geometry]}
    if geometry == "seb":
        specimen |= {"span_mm": known.span_mm, "length_mm": known.span_mm + 2 * OVERHANG_MM}
    f_max, delta_max = PUBLISHED[geometry]
    raw = {
        "format": 1,
        "name": name,
        "specimen": specimen,
        "loading": {"cmod_rate_mm_per_min": RATE_MM_PER_MIN[geometry], "cmod_max_mm": END_MM[geometry]},
        "material": {"mastic_modulus_gpa": known.modulus_gpa, "aggregate_modulus_gpa": known.aggregate_gpa},
        "model": {"particle_radius_mm": radius_mm},
        "start": {"f_max_n": f_max * radius_mm / 0.3, "delta_max_m": delta_max},
    }
    return Experiment.model_validate(raw)


def _problem(model: Model, geometry: str) -> Problem:
    bundle = model.bundle
    assert bundle.start is not None
    return model.problem(bundle.start.f_max_n, bundle.start.delta_max_m, frames=np.array([bundle.cmod_max / 2]))


def _spread(values: np.ndarray, form: str) -> str:
    return f"{np.median(values):{form}} ({values.min():{form}} to {values.max():{form}})"
