"""A measured concrete beam as a bundle: Grégoire et al. 2013, half-notched, with its scatter band.

Grégoire, Rojas-Solano, Pijaudier-Cabot, Int. J. Numer. Anal. Meth. Geomech. 37 (2013) 1434, "Beam 4": depth 50,
span 125, length 175, thickness 50, notch 25 mm. Modulus, strength and energy are those with which this beam was
modelled in the literature: E = 37 GPa, f_t = 3.9 MPa, G_f = 143.2 J/m².
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.units import MINUTE, MM
from pipeline.lmp.simulate import solve
from pipeline.store.bundle import read_bundle
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, write_bundle
from pipeline.store.records import Record, read_record
from pipeline.store.results import read_result
from pipeline.store.start import start_parameters
from pipeline.study.assembly import build_model
from pipeline.study.identify import identify

RECORD = Path("concrete_cmod_pypd") / "half_notched_beam.csv"
RATE = 0.05 * MM / MINUTE  # not recorded; nothing here depends on time
EXPERIMENT = {
    "format": 1,
    "name": "half-notched-beam",
    "specimen": {
        "geometry": "seb",
        "thickness_mm": 50.0,
        "depth_mm": 50.0,
        "span_mm": 125.0,
        "length_mm": 175.0,
        "notch_length_mm": 25.0,
        "gauge_length_mm": 4.0,
    },
    "loading": {"cmod_rate_mm_per_min": 0.05, "cmod_max_mm": 0.2},
    "material": {
        "mastic_modulus_gpa": 37.0,
        "poissons_ratio": 1 / 3,
        "plane": "stress",
        "tensile_strength_mpa": 3.9,
        "fracture_energy_j_per_m2": 143.2,
        "conversion": "lattice",
    },
    "observation": {"cmod_count": 10, "cmod_step_mm": 0.019},
}


def concrete_beam(data: Path, folder: Path, lattice_angle_deg: float = 90.0) -> Record:
    """Write the bundle of the beam from the folder of measured data; its record, with the band in load_std.

    The load is the middle of the measured envelope; its standard deviation a quarter of the envelope's width.
    """
    record = read_record(data / RECORD, cmod_rate=RATE)
    noise = {"load_std_n": float(f"{record.load_std:.4g}")}
    settings = EXPERIMENT | {"noise": noise, "model": {"lattice_angle_deg": lattice_angle_deg}}
    write_bundle(folder, Experiment.model_validate(settings), Contents(curve=record.curve))
    return record


def envelope_share(record: LoadCurve, cmod: np.ndarray, load: np.ndarray) -> tuple[float, float]:
    """How much of a simulated curve lies inside the envelope, and its largest excess (N).

    Parameters
    ----------
    record : LoadCurve whose load_std is a quarter of the envelope's width
    cmod, load : (n,) arrays, m and N; of the simulation

    Returns
    -------
    share of the measured CMOD range inside the envelope, largest distance outside it (N)
    """
    assert record.load_std is not None
    at = np.linspace(record.cmod[0], min(record.cmod[-1], cmod.max()), 400)
    simulated = np.interp(at, cmod, load)
    middle, half = (np.interp(at, record.cmod, y) for y in (record.load, 2 * record.load_std))
    excess = np.abs(simulated - middle) - half
    return float(np.mean(excess <= 0)), float(max(excess.max(), 0.0))


def beam_table(data: Path, folder: Path, radii_mm: tuple[float, ...] = (0.6, 0.3)) -> str:
    """The beam simulated with its published properties, at two radii and two lattice angles, as a Markdown table."""
    rows = [
        "| angle | radius | peak load | CMOD at peak | inside the envelope | largest excess |",
        "|---|---|---|---|---|---|",
    ]
    for angle in (90.0, 0.0):
        place = folder / f"beam-{angle:.0f}"
        record = read_record(data / RECORD, cmod_rate=RATE)
        if not (place / "experiment.toml").is_file():
            concrete_beam(data, place, angle)
        bundle = read_bundle(place)
        for radius in radii_mm:
            f_max, delta_max = start_parameters(bundle)
            curve = solve(build_model(bundle, radius * MM).problem(f_max, delta_max)).curve
            cmod, load = curve.peak()
            share, excess = envelope_share(record.curve, curve.cmod, curve.load)
            rows.append(
                f"| {angle:.0f}° | {radius} mm | {load:.0f} N | {cmod / MM:.4f} mm | {share:.0%} | {excess:.0f} N |"
            )
    return "\n".join(rows) + "\n"


def beam_identification(data: Path, folder: Path, radius_mm: float = 0.6) -> str:
    """The beam identified from load–CMOD alone, in sentences."""
    place, out = folder / "beam-90", folder / "identified"
    record = read_record(data / RECORD, cmod_rate=RATE)
    if not (place / "experiment.toml").is_file():
        concrete_beam(data, place)
    told = identify(place, out, objective="load", radius_mm=radius_mm)
    found = read_result(out)
    cmod, load = (np.array(found["load_cmod"][k], float) for k in ("cmod_mm", "load_n"))
    share, excess = envelope_share(record.curve, cmod * MM, load)
    area = 2 * 0.3 * MM * 50 * MM
    strength = np.sqrt(3) * found["f_max_n"] / area / 1e6
    energy = found["bond_fracture_energy_j_per_m2"]
    return (
        f"{told}\nf_t = {strength:.2f} MPa, G_f = {energy:.0f} J/m²; peak {found['peak_load_n']:.0f} N; "
        f"{share:.0%} of the curve inside the envelope, largest excess {excess:.0f} N"
    )
