"""What is wrong with the parts of a bundle, and between them; each function returns sentences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError, PipelineError
from pipeline.core.specimen import Specimen
from pipeline.core.units import MM
from pipeline.materials.elastic import stiffness_ratio
from pipeline.store import frames
from pipeline.store.experiment import FILE
from pipeline.store.fields import field_problems
from pipeline.store.images import image_size, read_grey, read_labels
from pipeline.store.plausibility import (
    clock_problems,
    curve_problems,
    motion_problems,
    place_problems,
    view_problems,
)
from pipeline.store.schema import opened
from pipeline.store.sections import KINDS, MaterialSection, SpecimenSection
from pipeline.store.sources import Sources


def cut(section: SpecimenSection | None, raw: Any, known: list[str]) -> tuple[Specimen | None, list[str]]:
    """The specimen, or None and what forbids it.

    Where [specimen] has faults of its own its numbers are tried as they are, so that a notch outside the
    specimen is told together with a negative thickness; what is `known` already is not told twice.
    """
    try:
        if section is not None:
            return section.specimen(), []
        _try_to_cut(raw)
    except InputError as error:
        parts = [part.strip() for part in str(error).split(";")]
        new = [part for part in parts if not any(f"] {part.split(' = ')[0]} = " in sentence for sentence in known)]
        return None, [f"{FILE}: [specimen] {part}" for part in new]
    return None, []


def _try_to_cut(raw: Any) -> None:
    """Cut the specimen from the raw numbers, for its refusals only."""
    section = KINDS.get(str(raw.get("geometry"))) if isinstance(raw, dict) else None
    if section is None:
        return
    names = [name for name in section.model_fields if name.endswith("_mm")]
    values = [raw.get(name, section.model_fields[name].default) for name in names]
    if all(isinstance(value, int | float) and abs(value) < 1e9 for value in values):  # neither NaN nor beyond a float
        section.kind(**{n.removesuffix("_mm"): float(v) * MM for n, v in zip(names, values, strict=True)})


def material_problems(material: MaterialSection | None, sources: Sources) -> list[str]:
    """Elastic constants that are missing or impossible, shear ratios that nothing can show."""
    if material is None:
        return []
    surface = sources.labels or sources.photograph
    rules = [
        (
            material.mastic_modulus is None and sources.creep is None,
            "mastic_modulus_gpa is missing: give it, or add creep.csv",
        ),
        (
            surface is not None and material.aggregate_modulus is None,
            f"aggregate_modulus_gpa is missing: {surface.name if surface else ''} needs it",
        ),
    ]
    return [f"{FILE}: [material] {sentence}" for broken, sentence in rules if broken] + _shear_problems(material)


def _shear_problems(material: MaterialSection) -> list[str]:
    """K^s < 0, or a tangential law asked for where K^s = 0."""
    try:
        ratio = stiffness_ratio(material.poissons_ratio, material.plane_state)
    except InputError as error:
        return [f"{FILE}: [material] {error}"]
    asked = [n for n in ("shear_strength_ratio", "shear_opening_ratio") if getattr(material, n) != 1]
    if ratio != 0 or not asked:
        return []
    return [
        f"{FILE}: [material] {name} = {getattr(material, name):g} cannot be identified: at poissons_ratio = "
        f"{material.poissons_ratio:g} in plane {material.plane} bonds have no shear stiffness (K^s = 0): leave it at "
        "1, or take a smaller poissons_ratio"
        for name in asked
    ]


def photograph_problems(section: SpecimenSection | None, specimen: Specimen | None, sources: Sources) -> list[str]:
    """A photograph or label image that cannot be read, or that lies off the specimen."""
    path = sources.labels or sources.photograph
    if path is None:
        return []
    try:
        shape = (read_labels(path) if sources.labels else read_grey(path)).shape
    except PipelineError as error:
        return [str(error)]
    if section is None:
        return []
    if section.image is None:
        return [f"{FILE}: [specimen.image] is missing: {path.name} needs mm_per_px and origin_px"]
    return view_problems(path.name, "specimen.image", section.image, shape, specimen) if specimen else []


def speckle_problems(
    sections: dict[str, Any], specimen: Specimen | None, sources: Sources, thorough: bool
) -> list[str]:
    """Speckle images that cannot be read, differ, lack their scale or lie off the specimen."""
    if not sources.images:
        return []
    problems = frames.image_problems(sources.images, thorough)
    if "camera" in sections and sections["camera"] is None:
        return [*problems, f"{FILE}: [camera] is missing: {frames.FOLDER}/ needs mm_per_px and origin_px"]
    if problems or specimen is None or "camera" not in sections:
        return problems
    shape = image_size(sources.images[0])
    return view_problems(f"{frames.FOLDER}/", "camera", sections["camera"], shape, specimen)


def record_problems(
    sections: dict[str, Any], specimen: Specimen | None, curve: LoadCurve | None, time: np.ndarray | None
) -> list[str]:
    """A record in wrong units, or on another clock than the images."""
    if curve is None:
        return []
    rate = sections["loading"].cmod_rate if "loading" in sections else None
    problems = curve_problems(curve, specimen, rate) if specimen else []
    if time is not None:
        offset = sections["dic"].sync_offset_s if "dic" in sections else None
        problems += clock_problems(frames.FILE, time - (offset or 0.0), curve)
    return problems


def field_file_problems(
    sections: dict[str, Any], specimen: Specimen | None, sources: Sources, curve: LoadCurve | None
) -> list[str]:
    """A field file that is damaged, of wrong shape or units, or on another clock than the record."""
    path = sources.fields
    if path is None:
        return []
    std = sections["noise"].displacement_std if "noise" in sections else None
    problems = field_problems(path, std is None)
    if problems or specimen is None:
        return problems
    with opened(path) as file:
        time, points = file["time_s"][()], file["points"][()] * MM
    problems = place_problems(path.name, points, specimen)
    if curve is None:
        return problems
    late = clock_problems(path.name, time, curve)
    return problems + (late or _unit_problems(path, time, points, curve))


def _unit_problems(path: Path, time: np.ndarray, points: np.ndarray, curve: LoadCurve) -> list[str]:
    """Judge the units of the displacements by the last frame within the record."""
    frame = int(np.flatnonzero(time <= curve.time[-1])[-1])
    with opened(path) as file:
        displacement = file["displacement"][frame] * MM
        std = file["std_mm"][()] * MM if "std_mm" in file else np.zeros(())
        usable = file["valid"][frame].astype(bool) & np.isfinite(displacement).all(axis=1)
    scatter = float(np.nanmedian(std)) if np.isfinite(std).any() else 0.0
    cmod = float(curve.cmod_at(time[frame]))
    return motion_problems(path.name, points[usable], displacement[usable], cmod, scatter)
