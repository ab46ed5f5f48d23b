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
from pipeline.store.experiment import Experiment
from pipeline.store.new import Contents, write_bundle
from pipeline.store.records import Record, read_record

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
