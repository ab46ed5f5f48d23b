"""A bundle with known truth, broken by another kind of model than the one that identifies."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.equilibrium.solve import solve as find_equilibria
from pipeline.execution.progress import Progress, Silent
from pipeline.materials.burgers import Burgers
from pipeline.microstructure.gradation import Grading, fuller_section
from pipeline.store.atomic import write_atomically
from pipeline.store.bundle import Bundle, read_bundle
from pipeline.store.creep_sheet import read_creep_sheet
from pipeline.store.experiment import Experiment
from pipeline.store.images import read_grey, read_labels
from pipeline.store.new import START_DELTA_MAX, START_F_MAX, Contents, first_experiment, write_bundle
from pipeline.study.assembly import grey_levels, read_phases, settings_of
from pipeline.study.creep_analysis import mastic_creep
from pipeline.study.effects import planned
from pipeline.study.filming import LATEST, Clock, draw_clock, film_of, write_film
from pipeline.study.opening_rate import solve_at_rates
from pipeline.study.output import TRUTH
from pipeline.study.request import CAMERA_MM_PER_PX, Request
from pipeline.study.truth import draw_truth, nominal, truth_text
from pipeline.twin.problem import Truth, one_phase
from pipeline.twin.virtual_test import Recording, VirtualTest
from pipeline.twin.virtual_test import virtual_test as break_network

SECTION_MM_PER_PX, SECTION_MARGIN_PX = 0.1, 5  # of a synthetic section
CMOD_MAX_MM = {"seb": 0.6, "dct": 0.65}  # beyond the paper's last station


def virtual_test(
    out: Path,
    *,
    config: Path | None = None,
    seed: int | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    **asked: Any,
) -> str:
    """Make a bundle of a virtual test in OUT; the truth goes to OUT/truth.json, which no other command reads.

    Parameters
    ----------
    out : folder that does not hold a bundle yet
    seed : of section, network, truth and noise
    asked : fields of `Request`
    """
    settings = settings_of(config, seed=seed, workers=workers)
    request, progress = Request(**asked), progress or Silent()
    of_section, of_truth, of_test, of_camera = np.random.default_rng(settings.seed).spawn(4)
    progress.stage("drawing the specimen")
    experiment, images = prepare(request, out.resolve().name, of_section)
    write_bundle(out, experiment, images)
    bundle = read_bundle(out)
    truth = draw_truth(request, bundle, of_truth)
    progress.stage("breaking it")
    clock = draw_clock(of_camera) if request.images else Clock()
    test = run_test(bundle, truth, request, clock, of_test)
    finished = with_noise(experiment, request)
    if request.images:
        film, finished = film_of(test, finished, request.camera_pitch, request.pixel_noise)
        write_film(out, film, finished, test, clock, of_camera, settings.workers, progress)
    else:
        write_bundle(out, finished, Contents(test.curve, test.field))
    write_atomically(out / TRUTH, truth_text(test, truth, request, clock, settings, bundle))
    cmod, load = test.curve.peak()
    return f"virtual test of {test.particles} points and {test.bonds} bonds: peak {load:.0f} N at {cmod / MM:.3f} mm"


def prepare(request: Request, name: str, rng: np.random.Generator) -> tuple[Experiment, Contents]:
    """Settings and specimen image of the bundle, before anything is broken."""
    if request.like is not None:
        experiment, images = imitate(read_bundle(request.like))
    else:
        geometry = request.geometry or "seb"
        experiment, images = first_experiment(geometry, name), Contents()
        loading = experiment.loading.model_copy(update={"cmod_max_mm": CMOD_MAX_MM[geometry]})
        experiment = experiment.model_copy(update={"loading": loading})
    experiment = at_radius(experiment, request)
    slow = images.creep
    if request.specimen is not None:
        experiment, images = with_image(experiment, request)
    elif request.like is None:
        experiment, images = with_section(experiment, rng)
    if request.creep is not None:
        slow, _ = read_creep_sheet(request.creep)
        experiment = without_modulus(experiment)
    return experiment, replace(images, creep=slow)


def imitate(bundle: Bundle) -> tuple[Experiment, Contents]:
    """The settings of a bundle, its specimen's image and the creep test of its mastic."""
    contents = Contents(creep=bundle.creep)
    if bundle.labels is not None:
        contents = replace(contents, labels=read_labels(bundle.labels))
    elif bundle.specimen_image is not None:
        contents = replace(contents, photograph=grey_levels(read_grey(bundle.specimen_image)))
    return bundle.experiment, contents


def at_radius(experiment: Experiment, request: Request) -> Experiment:
    """The settings at the particle radius and start that are asked for."""
    radius = request.radius_mm or experiment.model.particle_radius_mm
    thickness = experiment.specimen.thickness_mm
    f_max, delta_max = request.start or (START_F_MAX * (radius / 0.3) * (thickness / 40.0), START_DELTA_MAX)
    model = experiment.model.model_copy(update={"particle_radius_mm": radius})
    start = {"f_max_n": float(f"{f_max:.6g}"), "delta_max_m": delta_max}
    raw = experiment.model_copy(update={"model": model}).model_dump(exclude_none=True) | {"start": start}
    return Experiment.model_validate(raw)


def without_modulus(experiment: Experiment) -> Experiment:
    """The settings of a bundle whose creep test says how stiff its mastic is."""
    raw = experiment.model_dump(exclude_none=True)
    raw["material"].pop("mastic_modulus_gpa", None)
    return Experiment.model_validate(raw)


def with_image(experiment: Experiment, request: Request) -> tuple[Experiment, Contents]:
    """The specimen's image, its bottom edge at the mouth and its middle column on the notch line."""
    assert request.specimen is not None
    if request.mm_per_px is None:
        raise InputError("--specimen needs --mm-per-px, the scale of the image")
    image = grey_levels(read_grey(request.specimen))
    is_label = image.max() <= Phase.VOID
    frame = {"mm_per_px": request.mm_per_px, "origin_px": [(image.shape[1] - 1) / 2, image.shape[0] - 0.5]}
    contents = Contents(labels=image) if is_label else Contents(photograph=image)
    return _with_frame(experiment, frame), contents


def with_section(
    experiment: Experiment, rng: np.random.Generator, grading: Grading | None = None
) -> tuple[Experiment, Contents]:
    """A graded section drawn by chance, as label image."""
    specimen: Specimen = experiment.specimen.specimen()
    x0, y0, x1, y1 = specimen.bounds
    pitch, margin = SECTION_MM_PER_PX * MM, SECTION_MARGIN_PX
    columns, rows = (round(size / pitch) + 1 + 2 * margin for size in (x1 - x0, y1 - y0))
    section = fuller_section(columns * pitch, rows * pitch, pitch, rng, grading)
    frame = {
        "mm_per_px": SECTION_MM_PER_PX,
        "origin_px": [margin - float(f"{x0 / pitch:.9g}"), rows - 1 - margin + float(f"{y0 / pitch:.9g}")],
    }
    return _with_frame(experiment, frame), Contents(labels=section.label)


def _with_frame(experiment: Experiment, frame: dict[str, Any]) -> Experiment:
    raw = experiment.model_dump(exclude_none=True)
    raw["specimen"]["image"] = frame
    return Experiment.model_validate(raw)


def with_noise(experiment: Experiment, request: Request) -> Experiment:
    """The settings with the noise of the measurement, where the user could know it."""
    known = {"load_std_n": request.load_noise_n}
    if not request.images:  # that of images is for the correlation to find
        known["displacement_std_mm"] = request.displacement_noise * CAMERA_MM_PER_PX
    noted = {name: float(f"{value:.4g}") for name, value in known.items() if value > 0}
    return experiment.model_copy(update={"noise": experiment.noise.model_copy(update=noted)})


def recording_of(bundle: Bundle, request: Request, clock: Clock) -> Recording:
    """How machine and camera record the test."""
    rate, end = bundle.loading.cmod_rate, bundle.loading.cmod_max or CMOD_MAX_MM[bundle.specimen.geometry] * MM
    return Recording(
        cmod_rate=rate,
        cmod_max=end,
        frames=request.frame_count,
        before=clock.before,
        phase=clock.phase,
        rest=LATEST + (clock.before + 1) * end / rate / (request.frame_count - 1) if request.images else 0.0,
        displacement_std=request.displacement_noise * CAMERA_MM_PER_PX * MM,
        load_std=request.load_noise_n,
    )


def run_test(bundle: Bundle, truth: Truth, request: Request, clock: Clock, rng: np.random.Generator) -> VirtualTest:
    """Break an irregular network that stands for the bundle's specimen."""
    phase_map, _ = read_phases(bundle)
    recording = recording_of(bundle, request, clock)
    phase_at = one_phase if phase_map is None else phase_map.at
    material = nominal(bundle, request)
    return break_network(
        bundle.specimen,
        phase_at,
        material,
        truth,
        recording,
        request.pitch * bundle.model.radius,
        rng,
        partial(solve_at_rates, solve=find_equilibria),
        plan=planned(bundle.specimen, material, request.effects),
        mastic=_mastic(bundle, request),
        measuring=request.measuring,
    )


def _mastic(bundle: Bundle, request: Request) -> Burgers | None:
    """How the mastic creeps, if it does."""
    if not request.effects.get("creep"):
        return None
    if bundle.creep is None:
        raise InputError("the effect creep needs a creep test: give --creep FILE, or --like a bundle with creep.csv")
    return mastic_creep(bundle).burgers
