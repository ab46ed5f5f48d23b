"""The command `creep`: from a laboratory's creep record to the constants of the mastic."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.core.errors import InputError
from pipeline.core.units import GPA
from pipeline.execution.progress import Progress, Silent
from pipeline.materials.burgers_fit import NAMES, BurgersFit
from pipeline.materials.master_curve import MasterCurve
from pipeline.materials.prony import PronySeries
from pipeline.report.creep import creep_compliance, master_curve, relaxation_modulus, shift_factors
from pipeline.report.page import Number, Section, page
from pipeline.store.atomic import write_atomically
from pipeline.store.creep import FILE, encode_creep
from pipeline.store.creep_sheet import mean_record, read_creep_sheet
from pipeline.store.layouts import CREEP
from pipeline.store.results import write_arrays, write_result
from pipeline.study.creep_analysis import KELVIN, CreepAnalysis, analyse_creep
from pipeline.study.output import plain_folder
from pipeline.study.pages import picture, write_page

DRAWN = 200  # points of a drawn curve


def creep(
    file: Path,
    out: Path,
    *,
    temperature_c: float | None = None,
    window: tuple[float, float] | None = None,
    progress: Progress | None = None,
) -> str:
    """Fit a creep record; writes result.json, results.h5, creep.csv, figures and report.

    Parameters
    ----------
    file : creep record, any text dialect (`store.creep_sheet`)
    out : folder
    temperature_c : float, °C; of the fracture test. None: the only one measured, or that in the middle
    window : (first, last) s; part of the record that the Burgers model is fitted to. None: as long as was read
    """
    started = time.monotonic()
    (progress or Silent()).stage("creep compliance")
    record, told = read_creep_sheet(Path(file))
    if window is not None and not 0 < window[0] < window[1]:
        raise InputError(f"the times {window[0]:g} to {window[1]:g} s must be positive and increase")
    found = analyse_creep(record, temperature_c, window)
    folder = plain_folder(out, "creep")
    result = creep_result(found, Path(file).name, told, time.monotonic() - started)
    write_arrays(folder, CREEP, creep_arrays(found))
    write_atomically(folder / FILE, encode_creep(mean_record(record)))
    write_result(folder, result)
    _page(folder, found, result)
    return _summary(found)


def creep_result(found: CreepAnalysis, file: str, told: tuple[str, ...], seconds: float) -> dict[str, Any]:
    """The analysis by the keys of result.json."""
    model = found.burgers
    return {
        "version": __version__,
        "command": "creep",
        "seconds": seconds,
        "file": file,
        "readings": int(found.time.size),
        "temperature_c": found.temperature_c,
        "burgers": {
            "d1_per_gpa": model.d1 * GPA,
            "d2_per_gpa": model.d2 * GPA,
            "eta1_gpa_s": model.eta1 / GPA,
            "tau2_s": model.tau2,
        },
        "interval_95": _intervals(found.fit),
        "relaxation": _terms(model.relaxation()),
        "rms_log_error": found.fit.rms_log_error,
        "window_s": found.window,
        "residual_correlation": found.fit.correlation,
        "prony": {
            "creep": {
                "instantaneous_per_gpa": found.chain.instantaneous * GPA,
                "fluidity_per_gpa_s": found.chain.fluidity * GPA,
                "terms": [
                    {"compliance_per_gpa": d * GPA, "time_s": t}
                    for d, t in zip(found.chain.compliance, found.chain.time, strict=True)
                ],
            },
            "infinity_gpa": found.series.infinity / GPA,
            "relaxation": _terms(found.series),
            "rms_log_error": _rms(found),
        },
        "master_curve": None if found.master is None else _master(found.master),
        "shift_laws": _laws(found),
        "warnings": found.warnings,
        "remarks": told,
    }


def _intervals(fit: BurgersFit) -> dict[str, tuple[float, float]]:
    units = {"d1_per_gpa": GPA, "d2_per_gpa": GPA, "eta1_gpa_s": 1 / GPA, "tau2_s": 1.0}
    bounds = [fit.interval[name] for name in NAMES]
    return {key: (low * f, high * f) for (key, f), (low, high) in zip(units.items(), bounds, strict=True)}


def _terms(series: PronySeries) -> list[dict[str, float]]:
    return [{"modulus_gpa": e / GPA, "time_s": t} for e, t in zip(series.modulus, series.time, strict=True)]


def _rms(found: CreepAnalysis) -> float:
    """Of the series, over all readings."""
    difference = np.log(found.chain.creep_compliance(found.time) / found.record.compliance)
    return float(np.sqrt(np.mean(difference**2)))


def _master(master: MasterCurve) -> dict[str, Any]:
    rows = zip(master.temperature - KELVIN, master.log_shift, master.interval, strict=True)
    return {
        "reference_temperature_c": master.reference - KELVIN,
        "shifts": [{"temperature_c": round(t, 6), "log10_shift": a, "interval_95": i} for t, a, i in rows],
        "rms_relative_error": master.rms,
    }


def _laws(found: CreepAnalysis) -> dict[str, Any]:
    """Constants of WLF and Arrhenius at the reference temperature of the master curve."""
    said: dict[str, Any] = {}
    if "wlf" in found.laws:
        fitted = found.laws["wlf"]
        interval = {"c1": fitted.interval["c1"], "c2_k": fitted.interval["c2"]}
        law: Any = fitted.law
        said["wlf"] = {"c1": law.c1, "c2_k": law.c2, "interval_95": interval, "rms_log10": fitted.rms}
    if "arrhenius" in found.laws:
        fitted = found.laws["arrhenius"]
        law = fitted.law
        interval_kj = [value / 1e3 for value in fitted.interval["energy"]]
        said["arrhenius"] = {
            "activation_energy_kj_per_mol": law.energy / 1e3,
            "interval_95": {"activation_energy_kj_per_mol": interval_kj},
            "rms_log10": fitted.rms,
        }
    return said


def creep_arrays(found: CreepAnalysis) -> dict[str, Any]:
    """The arrays of an analysis, by the names of layout `CREEP`."""
    at = _drawn(found)
    low, high = found.fit.band(lambda model: model.creep_compliance(at))
    least, most = found.fit.band(lambda model: model.relaxation_modulus(at))
    master = found.master
    return {
        "measured/time_s": found.record.time,
        "measured/compliance_per_pa": found.record.compliance,
        "measured/temperature_c": found.record.temperature_c,
        "measured/reduced_time_s": found.time,
        "fit/time_s": at,
        "fit/compliance_per_pa": found.burgers.creep_compliance(at),
        "fit/compliance_95_per_pa": np.column_stack([low, high]),
        "fit/modulus_pa": found.burgers.relaxation_modulus(at),
        "fit/modulus_95_pa": np.column_stack([least, most]),
        "fit/log_covariance": found.fit.covariance,
        "prony/compliance_per_pa": found.chain.creep_compliance(at),
        "prony/modulus_pa": found.series.relaxation_modulus(at),
        "master/temperature_c": None if master is None else master.temperature - KELVIN,
        "master/log10_shift": None if master is None else master.log_shift,
        "master/covariance": None if master is None else master.covariance,
    }


def _drawn(found: CreepAnalysis) -> np.ndarray:
    """Times at which curves are drawn: half a decade beyond the readings."""
    return np.geomspace(found.time.min() / 3, found.time.max() * 3, DRAWN)


def _page(folder: Path, found: CreepAnalysis, result: dict[str, Any]) -> None:
    at, model, fit = _drawn(found), found.burgers, found.fit
    near = np.where((at >= found.window[0] / 3) & (at <= 3 * found.window[1]), 1.0, np.nan)  # Burgers ends there
    low, high = (near * edge for edge in fit.band(lambda m: m.creep_compliance(at)))
    least, most = (near * edge for edge in fit.band(lambda m: m.relaxation_modulus(at)))
    compliances = {"Burgers": near * model.creep_compliance(at), "series": found.chain.creep_compliance(at)}
    moduli = {"Burgers": near * model.relaxation_modulus(at), "series": found.series.relaxation_modulus(at)}
    window = found.window if np.isnan(near).any() else None
    figures = [
        picture(
            folder,
            "creep_compliance",
            lambda a: creep_compliance(a, found.time, found.record.compliance, at, compliances, (low, high), window),
            "Creep compliance: readings, Burgers fit with its 95 % band, and the non-negative series.",
        ),
        picture(
            folder,
            "relaxation_modulus",
            lambda a: relaxation_modulus(a, at, moduli, (least, most), window),
            "Relaxation modulus by exact interconversion of both.",
        ),
    ]
    sections = [Section("The mastic", numbers=_numbers(found, result), figures=figures, notes=result["remarks"])]
    if found.master is not None:
        sections.append(_master_section(folder, found))
    at_temperature = "" if found.temperature_c is None else f" at {found.temperature_c:g} °C"
    html = page(
        result["file"],
        sections,
        subtitle=f"creep compliance{at_temperature}, {result['readings']} readings",
        warnings=found.warnings,
        footer=[f"cohesive-bpm {result['version']}, command creep"],
    )
    write_page(folder, html)


def _numbers(found: CreepAnalysis, result: dict[str, Any]) -> list[Number]:
    names = {"d1_per_gpa": ("D₁", "1/GPa"), "d2_per_gpa": ("D₂", "1/GPa"), "eta1_gpa_s": ("η₁", "GPa s")}
    names["tau2_s"] = ("τ₂", "s")
    rows = [
        Number(name, f"{result['burgers'][key]:.4g} {unit}", _between(result["interval_95"][key], unit))
        for key, (name, unit) in names.items()
    ]
    arms = ", ".join(f"{t['modulus_gpa']:.4g} GPa at {t['time_s']:.4g} s" for t in result["relaxation"])
    return [
        *rows,
        Number("E(0)", f"{1 / (found.burgers.d1 * GPA):.4g} GPa", "1/D₁, the modulus of an elastic simulation"),
        Number("relaxation", arms, "two arms, exact; E(∞) = 0"),
        Number("fit", f"{result['rms_log_error']:.2%}", "rms of ln D, Burgers"),
        Number("series", f"{result['prony']['rms_log_error']:.2%}", f"{found.chain.time.size} terms, all readings"),
    ]


def _between(interval: tuple[float, float], unit: str) -> str:
    low, high = ("no bound" if np.isnan(value) else f"{value:.4g}" for value in interval)
    return f"95 %: {low} to {high} {unit}"


def _master_section(folder: Path, found: CreepAnalysis) -> Section:
    master, record = found.master, found.record
    assert master is not None
    assert record.temperature_c is not None
    kelvin = np.linspace(master.temperature[0], master.temperature[-1], DRAWN)
    names = {"wlf": "WLF", "arrhenius": "Arrhenius"}
    laws = {names[name]: fitted.law.log_shift(kelvin) for name, fitted in found.laws.items()}
    reduced, level = found.time, record.temperature_c + KELVIN
    figures = [
        picture(
            folder,
            "master_curve",
            lambda a: master_curve(a, reduced, record.compliance, level),
            f"Readings shifted to {found.temperature_c:g} °C.",
        ),
        picture(
            folder,
            "shift_factors",
            lambda a: shift_factors(a, master.temperature, master.log_shift, master.interval, kelvin, laws),
            f"Shifts against {master.reference - KELVIN:.4g} °C, and the laws through them.",
        ),
    ]
    return Section("Master curve", figures=figures)


def _summary(found: CreepAnalysis) -> str:
    model = found.burgers
    text = (
        f"D1 = {model.d1 * GPA:.4g} 1/GPa, D2 = {model.d2 * GPA:.4g} 1/GPa, eta1 = {model.eta1 / GPA:.4g} GPa s, "
        f"tau2 = {model.tau2:.4g} s; rms of ln D {found.fit.rms_log_error:.2%}"
    )
    at = "" if found.temperature_c is None else f"at {found.temperature_c:g} °C: "
    return "\n".join([at + text, *found.warnings])
