"""One fracture test of a bundle's specimen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__
from pipeline.core.curve import LoadCurve
from pipeline.core.errors import InputError
from pipeline.core.particles import Phase
from pipeline.core.problem import Problem, Solution
from pipeline.core.specimen import Specimen, ligament_area
from pipeline.core.units import MM
from pipeline.core.work_of_fracture import END_LOAD, cmod_fracture_energy
from pipeline.execution.processes import workers_of
from pipeline.execution.progress import Progress, Silent
from pipeline.execution.simulations import run_all
from pipeline.store.bundle import read_bundle
from pipeline.store.layouts import SIMULATE
from pipeline.store.problem_key import problem_key
from pipeline.store.results import prepare_output, write_arrays, write_result
from pipeline.store.simulation import SimulationStore
from pipeline.study.assembly import build_model, settings_of
from pipeline.study.effects import lattice_problem, physics_effects, planned, settled
from pipeline.study.engines import engine as engine_of
from pipeline.study.observation import observe_solution
from pipeline.study.output import results_folder
from pipeline.study.pages import simulation_page


def simulate(
    bundle: Path,
    out: Path,
    *,
    f_max: float,
    delta_max: float,
    engine: str | None = None,
    radius_mm: float | None = None,
    accuracy: float | None = None,
    ranks: int | None = None,
    effect: Sequence[tuple[str, float]] | None = None,
    law: str | None = None,
    config: Path | None = None,
    progress: Progress | None = None,
) -> str:
    """Simulate a bundle's test at one pair of parameters; writes result.json, results.h5, figures, report.

    Parameters
    ----------
    bundle, out : folders
    f_max : float, N, per bond of the bundle's lattice
    delta_max : float, m
    effect : (name, value) pairs of physics effects; what the model leaves out
    law : a shape of softening instead of the bundle's, or "burgers": the mastic creeps as creep.csv says
    engine, radius_mm, accuracy, ranks : override the settings of `config`
    """
    wanted = physics_effects(effect)
    settings = settings_of(config, engine=engine, radius_mm=radius_mm, accuracy=accuracy, ranks=ranks)
    chosen = engine_of(settings.engine, settings.ranks)
    workers_of(settings.ranks, None)  # refuses before any work is done
    read = read_bundle(bundle)
    folder = results_folder(out, read)
    model = build_model(read, settings.radius)
    problem = model.problem(f_max, delta_max, accuracy=settings.accuracy, law=law)
    if wanted:
        if law is not None:
            raise InputError(f"--law {law} and --effect cannot be asked for together: give one of them")
        plan = planned(read.specimen, model.mixture, wanted)
        problem = lattice_problem(model, plan, problem, f_max, delta_max)
    store = SimulationStore(prepare_output(folder / "simulations"))
    key = problem_key(problem, chosen.label)
    progress = progress or Silent()
    cost = f": {chosen.expectation(problem)}" if chosen.expectation else ""
    progress.stage(f"simulating{cost}")
    name = f"f_max = {f_max:.4g} N, delta_max = {delta_max:.4g} m"
    run_all(chosen.solve, {key: problem}, store, workers=1, progress=progress, names={key: name})
    solution = store.get(key)
    assert solution is not None
    solution = settled(problem, solution)
    points = read.observation_points
    seen = observe_solution(problem, solution, points)
    result = {"version": __version__, "command": "simulate", "seconds": solution.seconds, "engine": settings.engine}
    result |= {
        "bundle": read.name,
        "f_max_n": f_max,
        "delta_max_m": delta_max,
        "remarks": list(model.remarks),
        "effects": wanted,
    }
    result |= test_result(problem, solution, points, seen)
    write_arrays(folder, SIMULATE, simulation_arrays(problem, solution, points, seen))
    write_result(folder, result)
    simulation_page(folder, model, problem, solution, result)
    cmod, load = solution.curve.peak()
    return f"peak load {load:.0f} N at CMOD {cmod / MM:.3f} mm; quasi-static error {solution.quasi_static_error:.2%}"


def test_result(problem: Problem, solution: Solution, points: np.ndarray, seen: np.ndarray) -> dict[str, Any]:
    """The numbers of one simulated test, by the keys of result.json.

    The fracture energy is the machine's work up to the end of the test over the ligament area; the area
    under load–CMOD, larger, is given beside it.
    """
    curve, energy = solution.curve, solution.energy
    cmod, load = curve.peak()
    return {
        "peak_load_n": load,
        "cmod_at_peak_mm": cmod / MM,
        "fracture_energy_j_per_m2": energy.external / ligament_area(problem.specimen),
        "external_work_j": energy.external,
        "stored_j": energy.stored,
        "dissipated_j": energy.dissipated,
        "kinetic_j": energy.kinetic,
        "damping_j": energy.damping,
        "energy_error": energy.error,
        "cmod_area_j": curve.cmod_area(),
        **cmod_energy(curve, problem.specimen),
        "particles": problem.particles.count,
        "bonds": problem.bonds.count,
        "broken_bonds": int(np.count_nonzero(solution.reached >= problem.law.delta_end)),
        "by_phase": breakage(problem, solution),
        "steps": solution.steps,
        "quasi_static_error": solution.quasi_static_error,
        "converged": solution.converged,
        "load_cmod": curve_result(solution),
        "observation": {
            "cmod_mm": solution.cmod / MM,
            "points_mm": points / MM,
            "displacement_mm": seen / MM,
            "load_n": curve.load_at(solution.cmod),
        },
    }


def cmod_energy(curve: LoadCurve, specimen: Specimen) -> dict[str, Any]:
    """Fracture energy as ASTM D7313 reads it, and whether the load fell as far as the standard asks (0.1 kN).

    A specimen that never carries as much is integrated to the end.
    """
    end_load = END_LOAD if curve.load.max() > END_LOAD else 0.0
    found = cmod_fracture_energy(curve, ligament_area(specimen), end_load)
    return {
        "cmod_fracture_energy_j_per_m2": found.energy,
        "cmod_fracture_energy_complete": found.complete and end_load == END_LOAD,
    }


def breakage(problem: Problem, solution: Solution) -> dict[str, dict[str, float]]:
    """Broken bonds and dissipated energy of each phase of bonds: what the crack had to break."""
    broken = solution.reached >= problem.law.delta_end
    spent = problem.law.dissipated(solution.reached)
    return {
        Phase(phase).name.lower(): {
            "broken_bonds": int(np.count_nonzero(broken & (problem.bonds.phase == phase))),
            "dissipated_j": float(spent[problem.bonds.phase == phase].sum()),
        }
        for phase in np.unique(problem.bonds.phase).tolist()
    }


def curve_result(solution: Solution) -> dict[str, Any]:
    """A simulated record by the keys of result.json, at most a thousand rows."""
    curve = solution.curve
    assert curve.load_line is not None
    rows = np.unique(np.linspace(0, curve.time.size - 1, 1000).astype(int))
    return {
        "time_s": curve.time[rows],
        "cmod_mm": curve.cmod[rows] / MM,
        "load_n": curve.load[rows],
        "load_line_mm": curve.load_line[rows] / MM,
    }


def simulation_arrays(problem: Problem, solution: Solution, points: np.ndarray, seen: np.ndarray) -> dict[str, Any]:
    """The arrays of one simulated test, by the names of layout `SIMULATE`."""
    curve = solution.curve
    return {
        "curve/time_s": curve.time,
        "curve/cmod_m": curve.cmod,
        "curve/load_n": curve.load,
        "curve/load_line_m": curve.load_line,
        "cmod_m": solution.cmod,
        "particles/position_m": problem.particles.position,
        "particles/phase": problem.particles.phase,
        "particles/displacement_m": solution.displacement,
        "bonds/pairs": problem.bonds.pairs,
        "bonds/phase": problem.bonds.phase,
        "bonds/reached_m": solution.reached,
        "observation/points_m": points,
        "observation/displacement_m": seen,
    }
