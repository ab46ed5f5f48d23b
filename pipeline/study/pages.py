"""What a finished command shows: figures as PNG beside the results, and one self-contained page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.field import rigid_residual
from pipeline.core.problem import Problem, Solution
from pipeline.core.units import MM
from pipeline.inverse.estimate import Estimate
from pipeline.inverse.objective import Rigid
from pipeline.inverse.observations import Measured
from pipeline.report.curves import energy_balance, load_cmod
from pipeline.report.fields import difference_by_station, displacement_map, displacement_vectors
from pipeline.report.microstructure import bond_damage, phases
from pipeline.report.objective import objective_surface
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.style import Draw, png
from pipeline.store.atomic import write_atomically
from pipeline.study.assembly import Model

WIDE = {"width": 180.0, "height": 86.0}  # mm


def model_page(folder: Path, model: Model, result: Mapping[str, Any]) -> None:
    """Picture and counts of a specimen's model."""
    report = model.report
    numbers = [
        Number("particles", f"{report.particles}", f"of radius {result['radius_mm']:g} mm"),
        Number("bonds", f"{report.bonds}", ", ".join(f"{k} {n}" for k, n in result["bonds_by_phase"].items())),
        Number("stones", f"{report.stones}", f"aggregate {report.aggregate_fraction:.1%} of the particles"),
    ]
    sections = [Section("The model", numbers=numbers, figures=[_microstructure(folder, model)], notes=model.remarks)]
    write_page(folder, page(model.bundle.name, sections, subtitle="bonded-particle model", footer=_footer(result)))


def simulation_page(
    folder: Path, model: Model, problem: Problem, solution: Solution, result: Mapping[str, Any]
) -> None:
    """One simulated test: curve, energies, crack."""
    measured = model.bundle.curve
    figures = [
        picture(folder, "load_cmod", lambda a: load_cmod(a, measured, {"simulated": solution.curve}), "Load–CMOD."),
        picture(folder, "energy", lambda a: energy_balance(a, solution.energy), "Where the machine's work went."),
        _damage(folder, problem, solution),
        picture(
            folder,
            "displacement",
            lambda a: displacement_map(
                a, problem.specimen, problem.particles.position, problem.particles.radius, solution.displacement[-1], 0
            ),
            f"Displacement along x at a CMOD of {solution.cmod[-1] / MM:.3g} mm.",
            wide=True,
        ),
        _microstructure(folder, model),
    ]
    sections = [Section("One fracture test", numbers=_test_numbers(result), figures=figures, notes=model.remarks)]
    title = f"f_max = {result['f_max_n']:.4g} N, delta_max = {result['delta_max_m']:.4g} m"
    write_page(folder, page(model.bundle.name, sections, subtitle=title, footer=_footer(result)))


def identification_page(
    folder: Path,
    model: Model,
    measured: Measured,
    found: Estimate,
    problem: Problem,
    optimum: Solution,
    result: Mapping[str, Any],
) -> None:
    """The estimate, how well it fits, and how far to trust it."""
    curve = model.bundle.need_curve()
    fit = [
        picture(folder, "objective", lambda a: objective_surface(a, found), "Objective over the grid, its optimum."),
        picture(
            folder,
            "load_cmod",
            lambda a: load_cmod(a, curve, {"simulated at the optimum": optimum.curve}, measured.cmod),
            "Load–CMOD, measured and at the optimum.",
        ),
    ]
    sections = [
        Section("The estimate", numbers=_estimate_numbers(result), figures=fit, notes=_interval_notes(found)),
        *_field_sections(folder, model, measured, found),
        Section("The test at the optimum", figures=[_damage(folder, problem, optimum), _microstructure(folder, model)]),
    ]
    subtitle = f"identified from {found.settings.objective.value} by {found.objective.size} simulations"
    notes = [*found.warnings, *([] if found.interior else ["The optimum lies on the edge of the grid."])]
    html = page(model.bundle.name, sections, subtitle=subtitle, warnings=notes, footer=_footer(result))
    write_page(folder, html)


def _field_sections(folder: Path, model: Model, measured: Measured, found: Estimate) -> list[Section]:
    """Measured against simulated displacements, where fields were compared."""
    field = measured.field
    if field is None or found.displacement is None:
        return []
    fitted = found.comparison.rigid is Rigid.FIT
    simulated = np.where(np.isfinite(found.displacement), found.displacement, 0.0)
    used = found.comparison.use_field
    left = rigid_residual(field.points, field.displacement - simulated, used) if fitted else None
    against = simulated if left is None else field.displacement - left
    noise = float(np.sqrt(np.mean(field.std[used] ** 2)))
    draw: list[Draw] = [
        lambda a, k=k: displacement_vectors(  # type: ignore[misc]
            a,
            model.bundle.specimen,
            field.points,
            field.displacement[k],
            simulated[k],
            used[k],
            float(measured.cmod[k]),
            fitted,
        )
        for k in (0, len(measured.cmod) // 2)
        if used[k].any()
    ]
    panels = _panels(folder, "fields", draw, "Displacements at the observation points, measured and at the optimum.")
    difference = picture(
        folder,
        "difference",
        lambda a: difference_by_station(a, measured.cmod, field.displacement, against, used, noise),
        "What remains between measurement and simulation, against the noise.",
    )
    return [Section("Displacements", figures=[panels, difference])]


def _estimate_numbers(result: Mapping[str, Any]) -> list[Number]:
    interval = result["interval_95"]
    f_max = _between(interval and interval["f_max_n"], "N")
    delta_max = _between(interval and interval["delta_max_m"], "m")
    energy = _between(result["interval_95_bond_fracture_energy_j_per_m2"], "J/m²")
    return [
        Number("f_max", f"{result['f_max_n']:.4g} N", f_max),
        Number("delta_max", f"{result['delta_max_m']:.4g} m", delta_max),
        Number("f_max delta_max/(2 r t)", f"{result['bond_fracture_energy_j_per_m2']:.4g} J/m²", energy),
        Number("peak load", f"{result['peak_load_n']:.0f} N", f"{result['peak_load_mismatch']:+.1%} of the measured"),
        Number(
            "CMOD at peak",
            f"{result['cmod_at_peak_mm']:.3f} mm",
            f"{result['measured_cmod_at_peak_mm']:.3f} mm measured",
        ),
        Number("fracture energy", f"{result['fracture_energy_j_per_m2']:.0f} J/m²", "machine work over ligament area"),
        Number("inside the grid", "yes" if result["interior"] else "no", result["status"]),
        Number("quasi-static error", f"{result['quasi_static_error']:.2%}", "of the simulation at the optimum"),
    ]


def _between(interval: Sequence[float] | None, unit: str) -> str:
    return (
        "no interval: the optimum was not accepted"
        if interval is None
        else (f"95 %: {interval[0]:.4g} to {interval[1]:.4g} {unit}")
    )


def _interval_notes(found: Estimate) -> list[str]:
    if found.uncertainty is None:
        return []
    contains = [f"The intervals contain: {sentence}." for sentence in found.uncertainty.contains]
    return [*contains, *(f"They do not contain: {sentence}." for sentence in found.uncertainty.lacks)]


def _test_numbers(result: Mapping[str, Any]) -> list[Number]:
    return [
        Number("peak load", f"{result['peak_load_n']:.0f} N", f"at a CMOD of {result['cmod_at_peak_mm']:.3f} mm"),
        Number("fracture energy", f"{result['fracture_energy_j_per_m2']:.0f} J/m²", "machine work over ligament area"),
        Number("broken bonds", f"{result['broken_bonds']}", f"of {result['bonds']}"),
        Number(
            "quasi-static error", f"{result['quasi_static_error']:.2%}", f"the engine's own, {result['steps']} steps"
        ),
        Number("energy not accounted for", f"{result['energy_error']:.1e}", "of the machine's work"),
    ]


def _microstructure(folder: Path, model: Model) -> Figure:
    def draw(axes: Any) -> Any:
        return phases(axes, model.bundle.specimen, model.particles)

    return picture(folder, "microstructure", draw, "Particles of the model by phase.", wide=True)


def _damage(folder: Path, problem: Problem, solution: Solution) -> Figure:
    caption = "Bonds on their softening branch: 0 at the peak force, 1 broken."
    return picture(folder, "damage", lambda a: bond_damage(a, problem, solution.reached), caption, wide=True)


def picture(folder: Path, name: str, draw: Draw, caption: str, wide: bool = False) -> Figure:
    """Draw a figure, write it beside the results and return it for the page."""
    image = png(draw, width=WIDE["width"], height=WIDE["height"]) if wide else png(draw)
    write_atomically(folder / f"{name}.png", image)
    return Figure(image, caption, wide)


def _panels(folder: Path, name: str, draw: Sequence[Draw], caption: str) -> Figure:
    image = png(*draw, width=WIDE["width"], height=WIDE["height"], columns=max(len(draw), 1))
    write_atomically(folder / f"{name}.png", image)
    return Figure(image, caption, wide=True)


def _footer(result: Mapping[str, Any]) -> list[str]:
    engine = f", engine {result['engine']}" if "engine" in result else ""
    return [f"cohesive-bpm {result['version']}, command {result['command']}{engine}"]


def write_page(folder: Path, html: str) -> None:
    """Write report.html, whole or not at all."""
    write_atomically(folder / "report.html", html.encode())
