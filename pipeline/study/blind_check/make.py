"""Make sealed tests with engine C: anonymous bundles in OUT/bundles, the truth locked in OUT.vault."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.blind.calibration import SLIDING
from pipeline.blind.equilibrium import Path as Broken
from pipeline.blind.equilibrium import Setup
from pipeline.blind.equilibrium import solve as break_triangles
from pipeline.blind.record import MEASUREMENT, Camera, Recorder
from pipeline.blind.sample import PHYSICS, Material, Sample, continuum, setup_of
from pipeline.core.errors import ConvergenceError, InputError
from pipeline.core.specimen import Specimen
from pipeline.core.units import GPA, MM
from pipeline.dic.camera import View
from pipeline.dic.speckle import Camera as Lens
from pipeline.dic.speckle import Speckle, photograph
from pipeline.execution.progress import Progress, Silent
from pipeline.microstructure.phase_map import PhaseMap, from_labels
from pipeline.store.atomic import write_atomically
from pipeline.store.creep import CreepRecord
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, write_bundle
from pipeline.store.results import prepare_output
from pipeline.study.blind_check.cases import NOISE, SIZES, STRANGERS, Case, Size, drawn_cases, limits_of
from pipeline.study.blind_check.seal import BUNDLES, PLAN, SEAL, canonical, lock, salted, vault_of, write_seal
from pipeline.study.photography import camera_frame, view_of
from pipeline.study.virtual_test import CAMERA_MM_PER_PX, Request, prepare

SPREAD = 0.12  # the truth lies within ± this share of the start
MESHES = 4  # tried until one can be followed to the end
STILL = 4  # frames of the unloaded specimen
GRID, ROI = 1.6 * MM, 44 * MM  # of measured points
PIXEL_NOISE = 2.0  # grey values
BLUR = 0.6  # px
BEGUN = "begun.json"  # in the vault
CREEP_SHARE, CREEP_FLOW, CREEP_TIME = 0.3, 600.0, 12.0  # D₂/D₁, η₁ D₁ in s, τ₂ in s
CREEP_AT = np.geomspace(0.1, 300.0, 40)  # s


@dataclass(frozen=True, eq=False)
class Drawn:
    """One specimen before it is tested: settings, labels, phases, its true strength."""

    experiment: Experiment
    labels: np.ndarray
    phase_map: PhaseMap
    f_max: float
    delta_max: float

    @property
    def specimen(self) -> Specimen:
        return self.experiment.specimen.specimen()


@dataclass(frozen=True, eq=False)
class Scene:
    """A surface of triangles before a camera: which material is seen at each pixel."""

    pixel: np.ndarray
    origin: np.ndarray
    raster: Any

    def origin_on(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Material points (n, 2), px, seen on a raster, and whether there is any."""
        found: tuple[np.ndarray, np.ndarray] = self.raster(self.pixel, self.origin, columns, rows)
        return found


def make(
    out: Path, *, size: str = "small", seed: int = 0, limits: Path | None = None, progress: Progress | None = None
) -> str:
    """Break the cases of a check and seal them; goes on where it stopped.

    Parameters
    ----------
    out : folder; its vault is OUT.vault
    size : "small" or "full"
    seed : of specimens, truth, cases and noise
    limits : result.json of a diagnosis whose detection limits scale the effects

    Raises
    ------
    InputError
        where OUT is sealed already, or was begun with another size, seed or limits
    """
    out, progress = Path(out).resolve(), progress or Silent()
    vault, chosen = vault_of(out), SIZES[size]
    if (out / SEAL).exists():
        raise InputError(f"{out} is sealed already: run and open it, or choose another folder")
    for folder in (out / BUNDLES, vault):
        prepare_output(folder)
    of_cases, of_specimens, of_tests = (np.random.default_rng([seed, k]) for k in range(3))
    known = limits_of(limits)
    _begun(vault, {"size": size, "seed": seed, "limits": known, "version": __version__})
    cases = drawn_cases(size, known, of_cases)
    streams = of_tests.spawn(len(cases))
    progress.stage(f"breaking {len(cases)} tests")
    ready = [c.name for c in cases if (out / BUNDLES / c.name / "experiment.toml").exists()]
    progress.begin(len(cases), len(ready), "test")
    drawn: dict[int, Drawn] = {}
    states = of_specimens.spawn(len(chosen.specimens))
    rows, broken = {}, {}
    for number in range(len(chosen.specimens)):
        drawn[number] = draw(chosen.specimens[number], chosen, states[number])
    order = sorted(range(len(cases)), key=lambda k: _same(cases[k]))
    for k in order:
        case = cases[k]
        rows[case.name] = truth_row(case, drawn[case.specimen], known)
        if case.name in ready:
            continue
        if _same(case) not in broken:
            broken = {_same(case): crack(case, drawn[case.specimen], chosen, seed)}  # one at a time: they are large
        write_case(out / BUNDLES / case.name, case, drawn[case.specimen], broken[_same(case)], chosen, streams[k])
        progress.done(case.name)
    truth = salted({"format": 1, "size": size, "seed": seed, "version": __version__, "cases": rows})
    plan = {
        c.name: {"without": list(c.without)} | ({"replicates": c.replicates} if c.replicates else {}) for c in cases
    }
    (out / PLAN).write_bytes(canonical(plan))
    lock(truth, vault)
    made = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    write_seal(out, truth, vault, {"size": size, "made": made})
    return f"{len(cases)} sealed tests; their truth lies locked in {vault.name}"


def _begun(vault: Path, asked: dict[str, Any]) -> None:
    """Write down what is made; refuse to go on with something else."""
    file = vault / BEGUN
    if not file.exists():
        write_atomically(file, canonical(asked))
    elif file.read_bytes() != canonical(asked):
        raise InputError(
            f"{vault.with_suffix('').name} was begun with another size, seed, limits or version: go on with these, or "
            "choose another folder"
        )


def draw(geometry: str, size: Size, rng: np.random.Generator) -> Drawn:
    """A specimen with its section and its truth."""
    of_section, of_truth = rng.spawn(2)
    request = Request(geometry=geometry, radius_mm=size.radius_mm)
    experiment, contents = prepare(request, "specimen", of_section)
    loading = experiment.loading.model_copy(update={"cmod_max_mm": size.cmod_max_mm[geometry]})
    experiment = experiment.model_copy(update={"loading": loading})
    assert contents.labels is not None
    assert experiment.specimen.image is not None
    assert experiment.start is not None
    phase_map, _ = from_labels(contents.labels, experiment.specimen.image.placement())
    share = of_truth.uniform(1 - SPREAD, 1 + SPREAD, 2)
    truth = experiment.start.f_max_n * share[0], experiment.start.delta_max_m * share[1]
    return Drawn(experiment, contents.labels, phase_map, float(truth[0]), float(truth[1]))


def crack(case: Case, drawn: Drawn, size: Size, seed: int) -> tuple[Setup, Broken]:
    """Break the specimen of a case."""
    physics = {n: v for n, v in case.effects.items() if n in PHYSICS}
    material, specimen = material_of(drawn), drawn.specimen
    if case.stranger is not None:
        name, value = case.stranger
        if name not in STRANGERS:
            raise InputError(f"{name} is no stranger: it must be one of {', '.join(STRANGERS)}")
        if name == "aggregate_modulus":
            material = replace(material, aggregate_modulus=(1 + value) * material.aggregate_modulus)
        else:
            other: Any = specimen
            specimen = replace(other, gauge_length=(1 + value) * specimen.gauge_length)
    sample = Sample(
        specimen=specimen,
        phase_at=drawn.phase_map.at,
        material=material,
        effects=physics,
        edge=size.edge_mm * MM,
        cmod_rate=drawn.experiment.loading.cmod_rate,
    )
    assert drawn.experiment.loading.cmod_max is not None
    return broken_on_some_mesh(sample, [seed, 7, case.specimen], 1.002 * drawn.experiment.loading.cmod_max)


def broken_on_some_mesh(sample: Sample, seed: list[int], cmod_max: float) -> tuple[Setup, Broken]:
    """The sample broken on the first of a few meshes on which it can be followed.

    Raises
    ------
    ConvergenceError
        where none can: the last one's reason
    """
    for attempt in range(MESHES):
        try:
            setup = setup_of(sample, np.random.default_rng([*seed, attempt] if attempt else seed))
            return setup, break_triangles(setup, cmod_max)
        except ConvergenceError:
            if attempt == MESHES - 1:
                raise
    raise AssertionError("unreachable: the last mesh returns or raises")


def material_of(drawn: Drawn) -> Material:
    """What the bundle's settings mean for the continuum of engine C."""
    e = drawn.experiment
    m, radius, thickness = e.material, e.model.particle_radius_mm * MM, drawn.specimen.thickness
    assert m.mastic_modulus is not None
    assert m.aggregate_modulus is not None
    assert e.start is not None
    strength, energy = continuum(drawn.f_max, drawn.delta_max, radius, thickness)
    stone = continuum(
        m.aggregate_strength_ratio * e.start.f_max_n, m.aggregate_opening_ratio * e.start.delta_max_m, radius, thickness
    )
    d1 = 1 / m.mastic_modulus
    return Material(
        mastic_modulus=m.mastic_modulus,
        aggregate_modulus=m.aggregate_modulus,
        poissons_ratio=m.poissons_ratio,
        plane=m.plane,
        strength=strength,
        energy=energy,
        stone_strength=stone[0],
        stone_energy=stone[1],
        interface_strength=m.interface_strength_ratio,
        interface_opening=m.interface_opening_ratio,
        touching_is_stone=m.touching == "aggregate",
        shear=SLIDING * m.shear_strength_ratio,
        creep=(d1, CREEP_SHARE * d1, CREEP_FLOW / d1, CREEP_TIME),
    )


def creep_record(experiment: Experiment) -> CreepRecord:
    """The creep test of the mastic that lies in every bundle."""
    assert experiment.material.mastic_modulus_gpa is not None
    d1 = 1 / (experiment.material.mastic_modulus_gpa * GPA)
    growth = CREEP_AT / CREEP_FLOW + CREEP_SHARE * -np.expm1(-CREEP_AT / CREEP_TIME)
    return CreepRecord(CREEP_AT, d1 * (1 + growth))


def write_case(
    folder: Path, case: Case, drawn: Drawn, broken: tuple[Setup, Broken], size: Size, rng: np.random.Generator
) -> None:
    """The bundle of a case, with fields or images."""
    of_record, of_field, of_speckle, of_way = rng.spawn(4)
    noise_px, load_std = NOISE[case.noise]
    setup, path = broken
    e = drawn.experiment.model_copy(update={"name": case.name})
    displacement_std = noise_px * CAMERA_MM_PER_PX * MM
    shape, frame = camera_frame(drawn.specimen, size.camera_mm_per_px)
    view, points = view_of(frame), measuring_points(drawn.specimen)
    corners = view.point(np.array([(0, 0), (shape[1] - 1, shape[0] - 1)], float)) if case.images else points
    low, high = corners.min(axis=0), corners.max(axis=0)
    rate = drawn.experiment.loading.cmod_rate
    frames = size.pictures if case.images else size.frames
    step = float(path.cmod[-1]) / rate / frames
    camera = Camera(
        time=step * np.arange(STILL + frames),
        points=points,
        centre=(low + high) / 2,
        corner=float(np.hypot(*(high - low)) / 2),
        displacement_std=0.0 if case.images else displacement_std,
        load_std=load_std,
        rest=step * (STILL - 1),
        heading=float(of_way.uniform(0, 2 * np.pi)),
    )
    spoiling = {n: v for n, v in case.effects.items() if n in MEASUREMENT}
    recorder = Recorder(setup, path, drawn.specimen, camera, spoiling)
    noise = {"load_std_n": load_std} | ({} if case.images else {"displacement_std_mm": displacement_std / MM})
    e = e.model_copy(update={"noise": e.noise.model_copy(update={k: float(f"{v:.4g}") for k, v in noise.items()})})
    contents = Contents(recorder.curve(of_record), labels=drawn.labels, creep=creep_record(e))
    if case.images:
        e = e.model_copy(update={"camera": frame, "dic": e.dic.model_copy(update={"sync_offset_s": 0.0})})
        pictures = film(recorder, view, shape, of_speckle)
        contents = replace(contents, images=pictures, frame_time=recorder.stamped())
    else:
        contents = replace(contents, fields=recorder.field(of_field))
    write_bundle(folder, e, contents)


def film(recorder: Recorder, view: View, shape: tuple[int, int], rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Speckle images of a test, from the motion of its triangles."""
    of_pattern, of_noise = rng.spawn(2)
    speckle, lens = Speckle.scattered(shape, of_pattern), Lens(noise=PIXEL_NOISE, blur=BLUR)
    for time_ in recorder.camera.time.tolist():
        sheet = recorder.sheet(time_)
        scene = Scene(_pixels(view, sheet.seen), _pixels(view, sheet.material), sheet.raster)
        yield photograph(speckle, shape, scene, lens, of_noise)


def _pixels(view: View, corners: np.ndarray) -> np.ndarray:
    return view.pixel(corners.reshape(-1, 2)).reshape(corners.shape)


def measuring_points(specimen: Specimen) -> np.ndarray:
    """Grid (n, 2), m, of measured points around the tip, none on the notch line."""
    steps = (np.arange(int(ROI / GRID)) - int(ROI / GRID) / 2 + 0.5) * GRID
    x, y = np.meshgrid(steps, steps)
    points = np.column_stack([x.ravel(), y.ravel()]) + specimen.tip
    return points[specimen.contains(points)]


def planned(case: Case) -> dict[str, Any]:
    """What `run` must know of a case."""
    return {"without": list(case.without)} | ({"replicates": case.replicates} if case.replicates else {})


def truth_row(case: Case, drawn: Drawn, limits: dict[str, float]) -> dict[str, Any]:
    """What the truth table says of a case."""
    return {
        "specimen": f"specimen-{case.specimen}",
        "geometry": case.geometry,
        "kind": case.kind,
        "effects": dict(case.effects),
        "stranger": None if case.stranger is None else {case.stranger[0]: case.stranger[1]},
        "without": list(case.without),
        "replicates": case.replicates,
        "multiple": case.multiple,
        "detection_limit": {n: limits[n] for n in case.effects},
        "noise": case.noise,
        "images": case.images,
        "f_max_n": drawn.f_max,
        "delta_max_m": drawn.delta_max,
    }


def _same(case: Case) -> tuple[Any, ...]:
    """Cases with the same key are records of one broken specimen."""
    physics = tuple(sorted((n, v) for n, v in case.effects.items() if n in PHYSICS))
    return case.specimen, physics, case.stranger or ()
