"""The paper's inverse estimation: from a bundle to (f_max, delta_max)."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.core.problem import Problem, Solution
from pipeline.core.specimen import ligament_area
from pipeline.core.units import MM
from pipeline.execution.dask_workers import executor_of
from pipeline.execution.progress import Progress, Silent
from pipeline.inverse.estimate import Estimate
from pipeline.inverse.widened import Widened
from pipeline.store.bundle import read_bundle
from pipeline.store.layouts import IDENTIFY
from pipeline.store.results import write_arrays, write_result
from pipeline.study.assembly import settings_of
from pipeline.study.campaign import Campaign, prepare, run_optimum, search
from pipeline.study.pages import identification_page
from pipeline.study.simulate import cmod_energy, curve_result
from pipeline.study.widening import widened_lines, widened_result, widening


def identify(
    bundle: Path,
    out: Path,
    *,
    engine: str | None = None,
    grid: tuple[float, ...] | None = None,
    objective: str | None = None,
    radius_mm: float | None = None,
    accuracy: float | None = None,
    fields: Path | None = None,
    levelling: bool | None = None,
    placements: int | None = None,
    viscoelastic: bool | None = None,
    config: Path | None = None,
    workers: int | None = None,
    ranks: int | None = None,
    dask: str | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
) -> str:
    """Estimate f_max and delta_max of the mastic; writes result.json, results.h5, figures, report.

    Finished simulations are kept in OUT/simulations: the same call goes on where it stopped.

    Parameters
    ----------
    bundle, out : folders
    fields : a field file instead of the bundle's own
    levelling : send simulated fields through the correlation before they are compared
    placements : other placements of the lattice that are averaged at the optimum
    viscoelastic : let the mastic creep as the bundle's creep.csv says, in the time of the record
    the others : override the settings of `config`
    """
    started = time.monotonic()
    options = {"engine": engine, "grid": grid, "objective": objective, "radius_mm": radius_mm}
    options |= {"accuracy": accuracy, "workers": workers, "ranks": ranks, "dask": dask, "seed": seed}
    options |= {"levelling": levelling or None, "placement_count": placements, "viscoelastic": viscoelastic}
    settings = settings_of(config, **options)
    read = read_bundle(bundle, fields)
    progress = progress or Silent()
    with executor_of(settings.dask) as executor:
        campaign, aim, folder = prepare(read, out, settings, progress, executor)
        found = search(campaign, aim)
        problem, optimum = run_optimum(campaign, found)
        more = widening(campaign, found)
    return conclude(campaign, folder, found, problem, optimum, time.monotonic() - started, more)


def conclude(
    campaign: Campaign,
    folder: Path,
    found: Estimate,
    problem: Problem,
    optimum: Solution,
    seconds: float,
    more: Widened | None = None,
) -> str:
    """Write result.json, results.h5, figures and report of an estimate; the sentence to print."""
    result = identification_result(campaign, found, problem, optimum, seconds)
    result["more_parameters"] = widened_result(more)
    result["warnings"] += [] if more is None else list(more.warnings)
    write_arrays(folder, IDENTIFY, identification_arrays(campaign, found, optimum))
    write_result(folder, result)
    identification_page(folder, campaign.model, campaign.measured, found, problem, optimum, result)
    return "\n".join([_summary(found, (*campaign.model.remarks, *campaign.remarks)), *widened_lines(more)])


def identification_result(
    campaign: Campaign, found: Estimate, problem: Problem, optimum: Solution, seconds: float
) -> dict[str, Any]:
    """The numbers of an identification by the keys of result.json; f_max per bond of the bundle's lattice."""
    bundle = campaign.model.bundle
    area = 2 * bundle.model.radius * problem.specimen.thickness
    return {
        "version": __version__,
        "command": "identify",
        "bundle": bundle.name,
        "geometry": problem.specimen.geometry,
        "thickness_mm": problem.specimen.thickness / MM,
        "temperature_c": bundle.loading.temperature_c,
        "cmod_rate_mm_per_min": bundle.loading.cmod_rate_mm_per_min,
        "bond_area_mm2": area / MM**2,
        "seconds": seconds,
        "engine": campaign.settings.engine,
        "radius_mm": problem.particles.radius / MM,
        "viscoelastic": campaign.settings.viscoelastic,
        **estimate_result(found, area),
        "remarks": [*campaign.model.remarks, *campaign.remarks],
        "simulations": len(campaign.used),
        **optimum_result(campaign, problem, optimum),
    }


def estimate_result(found: Estimate, area: float) -> dict[str, Any]:
    """The estimate, its intervals and how it was made; area (m²) is that of one bond."""
    doubt = found.uncertainty
    return {
        "f_max_n": found.f_max,
        "delta_max_m": found.delta_max,
        "bond_fracture_energy_j_per_m2": 2 * found.bond_energy / area,
        "interval_95": doubt and {"f_max_n": doubt.f_max, "delta_max_m": doubt.delta_max},
        "interval_95_bond_fracture_energy_j_per_m2": doubt and [2 * e / area for e in doubt.bond_energy],
        "interval_contains": doubt and doubt.contains,
        "interval_lacks": doubt and doubt.lacks,
        "interval_noise_only": doubt
        and {"f_max_n": doubt.noise_only["f_max"], "delta_max_m": doubt.noise_only["delta_max"]},
        "correlation": doubt and doubt.correlation,
        "covariance": doubt and doubt.covariance,
        "objective": found.settings.objective,
        "surrogate": found.settings.surrogate,
        "paper": paper_result(found),
        "second_surrogate": {
            "kind": "radial basis functions",
            "f_max_n": found.radial_position[0],
            "delta_max_m": found.radial_position[1],
        },
        "objective_min": found.minimum.value,
        "interior": found.interior,
        "accepted": found.accepted,
        "status": found.status,
        "converged": found.minimum.converged and found.accepted,
        "warnings": list(found.warnings),
        "grid": {
            "f_max_n": found.design.f_max,
            "delta_max_m": found.design.delta_max,
            "objective": found.objective,
        },
        "surrogate_loo_error": found.loo_error,
    }


def optimum_result(campaign: Campaign, problem: Problem, optimum: Solution) -> dict[str, Any]:
    """The simulated test at the estimate beside the measured one."""
    cmod, load = optimum.curve.peak()
    record = campaign.model.bundle.need_curve()
    measured_cmod, measured_load = record.peak()
    measured_energy = cmod_energy(record.until(float(optimum.curve.cmod[-1])), problem.specimen)
    return {
        "quasi_static_error": optimum.quasi_static_error,
        "load_cmod": curve_result(optimum),
        "peak_load_n": load,
        "cmod_at_peak_mm": cmod / MM,
        "measured_peak_load_n": measured_load,
        "measured_cmod_at_peak_mm": measured_cmod / MM,
        "peak_load_mismatch": load / measured_load - 1,
        "fracture_energy_j_per_m2": optimum.energy.external / ligament_area(problem.specimen),
        **cmod_energy(optimum.curve, problem.specimen),
        "measured_cmod_fracture_energy_j_per_m2": measured_energy["cmod_fracture_energy_j_per_m2"],
    }


def paper_result(found: Estimate) -> dict[str, Any]:
    """What the paper's multinomial of the objective gives on the same grid."""
    minimum = found.multinomial_minimum
    f_max, delta_max = minimum.position
    return {"f_max_n": f_max, "delta_max_m": delta_max, "interior": minimum.interior, "objective_min": minimum.value}


def identification_arrays(campaign: Campaign, found: Estimate, optimum: Solution) -> dict[str, Any]:
    """The arrays of an identification, by the names of layout `IDENTIFY`."""
    measured, field = campaign.measured, campaign.measured.field
    runs = campaign.kept(found.design.nodes())
    shape = found.design.shape
    seen = campaign.seen(runs) if field is not None else None
    return {
        "grid/f_max_n": found.design.f_max,
        "grid/delta_max_m": found.design.delta_max,
        "grid/objective": found.objective,
        "grid/load_n": np.reshape([s.curve.load_at(measured.cmod) for _, s in runs], (*shape, -1)),
        "grid/displacement_m": None if seen is None else np.reshape(seen, (*shape, *np.shape(seen[0]))),
        "stations/cmod_m": measured.cmod,
        "points_m": None if field is None else campaign.points,
        "measured/load_n": measured.load,
        "measured/load_std_n": measured.load_std,
        "measured/displacement_m": None if field is None else field.displacement,
        "measured/valid": None if field is None else field.valid,
        "optimum/time_s": optimum.curve.time,
        "optimum/cmod_m": optimum.curve.cmod,
        "optimum/load_n": optimum.curve.load,
        "optimum/load_line_m": optimum.curve.load_line,
    }


def _summary(found: Estimate, remarks: tuple[str, ...]) -> str:
    text = f"f_max = {found.f_max:.4g} N, delta_max = {found.delta_max:.4g} m"
    if found.uncertainty is not None:
        (a, b), (c, d) = found.uncertainty.f_max, found.uncertainty.delta_max
        text += f"; 95 %: {a:.4g} to {b:.4g} N, {c:.4g} to {d:.4g} m"
    return "\n".join([text, *found.warnings, *remarks])
