"""The truth of a virtual test: drawn, written beside its bundle, and known again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline import __version__
from pipeline.config import RunSettings
from pipeline.core.errors import InputError
from pipeline.core.units import GPA, MM
from pipeline.materials.burgers import Burgers
from pipeline.materials.mixture import Mixture
from pipeline.store.bundle import Bundle
from pipeline.store.results import plain
from pipeline.study.assembly import mixture
from pipeline.study.filming import Clock
from pipeline.study.output import TRUTH
from pipeline.study.request import CAMERA_MM_PER_PX, Request
from pipeline.twin.calibration import calibrated_factors
from pipeline.twin.problem import Truth
from pipeline.twin.virtual_test import VirtualTest

SPREAD = 0.12  # the truth lies within ± this share of the start, unless it is given


def draw_truth(request: Request, bundle: Bundle, rng: np.random.Generator) -> Truth:
    """The truth that is asked for, or one near the start."""
    assert bundle.start is not None
    share = rng.uniform(1 - SPREAD, 1 + SPREAD, 2)
    f_max = request.f_max or bundle.start.f_max_n * share[0]
    delta_max = request.delta_max or bundle.start.delta_max_m * share[1]
    return Truth(float(f_max), float(delta_max), bundle.model.radius)


def nominal(bundle: Bundle, request: Request) -> Mixture:
    """What is broken, but for effects."""
    known = mixture(bundle)
    return known if request.poissons_ratio is None else replace(known, poissons_ratio=request.poissons_ratio)


def made_already(bundle: Path) -> bool:
    """Whether a virtual test lies there, made with the network's factors that are in force.

    Raises
    ------
    InputError
        where it was made with others, for its truth is another one, or does not say with which
    """
    path = bundle / TRUTH
    if not path.is_file():
        return False
    valid = plain(vars(calibrated_factors()))
    try:
        factors = json.loads(path.read_text("utf-8"))["factors"]
    except (ValueError, KeyError, TypeError):
        factors = "unknown"
    if factors != valid:
        raise InputError(
            f"{bundle} was made with other factors of the network ({factors}) than are in force ({valid}): "
            "choose another folder for the output, or go on with the version that began it"
        )
    return True


def truth_text(
    test: VirtualTest, truth: Truth, request: Request, clock: Clock, settings: RunSettings, bundle: Bundle
) -> bytes:
    """truth.json: what was put in, and how the network stands for it."""
    known = {
        "version": __version__,
        "f_max_n": truth.f_max,
        "delta_max_m": truth.delta_max,
        "radius_mm": truth.radius / MM,
        "bond_fracture_energy_j_per_m2": truth.f_max * truth.delta_max / (2 * truth.radius * bundle.specimen.thickness),
        "seed": settings.seed,
        "network": {
            "pitch_mm": test.pitch / MM,
            "points": test.particles,
            "bonds": test.bonds,
            "poissons_ratio": nominal(bundle, request).poissons_ratio,
        },
        "factors": vars(test.factors),
        "noise": _noise(request),
        "effects": request.effects,
        "creep": _constants(test.mastic),
        "sync_offset_s": clock.offset,
        "factors_check": vars(test.check),
        "energy_error": test.solution.energy.error,
    }
    return (json.dumps(plain(known), indent=2, sort_keys=True) + "\n").encode()


def _constants(mastic: Burgers | None) -> dict[str, float] | None:
    """How the mastic crept, by the names of the command `creep`."""
    if mastic is None:
        return None
    in_gpa = {"d1_per_gpa": mastic.d1 * GPA, "d2_per_gpa": mastic.d2 * GPA, "eta1_gpa_s": mastic.eta1 / GPA}
    return in_gpa | {"tau2_s": mastic.tau2}


def _noise(request: Request) -> dict[str, float]:
    """The noise that was put in."""
    if request.images:
        return {"grey": request.pixel_noise, "mm_per_px": request.camera_pitch, "load_n": request.load_noise_n}
    return {
        "displacement_px": request.displacement_noise,
        "mm_per_px": CAMERA_MM_PER_PX,
        "load_n": request.load_noise_n,
    }
