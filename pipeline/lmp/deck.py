"""The generated files that stand beside a plain deck: values, bond coefficients, grips."""

from __future__ import annotations

import shutil
from importlib.resources import as_file, files
from importlib.resources.abc import Traversable
from pathlib import Path

from pipeline.core.clock import Clock
from pipeline.core.problem import Grip, Problem
from pipeline.explicit.loading import Loading, loading_rule
from pipeline.explicit.modes import Modes, lowest_modes, shear_stiffness
from pipeline.lmp.data_file import write_data_file
from pipeline.lmp.law_table import LawTable, law_table
from pipeline.materials.creeping_softening import refuse_timeless

DECK = "fracture.lmp"


def write_deck(folder: Path, problem: Problem, stretch: int = 0) -> Loading:
    """Write a folder in which `lmp -in fracture.lmp` runs the problem; the loading it will use.

    Parameters
    ----------
    folder : Path
    problem : Problem
    stretch : int; steps from one restart file to the next, a multiple of the steps between records; 0: none
    """
    refuse_timeless(problem)
    table = law_table(problem)
    modes = lowest_modes(problem)
    loading = loading_rule(problem, modes)
    spin = None if shear_stiffness(problem) is None else loading.first_rate * modes.rotation
    write_data_file(folder / "specimen.data", problem, table, loading.first_rate * modes.response, spin)
    (folder / "settings.inc").write_text(_settings(problem, loading, stretch), encoding="ascii")
    (folder / "bonds.inc").write_text(_coefficients(table), encoding="ascii")
    (folder / "attachments.inc").write_text(_attachments(problem), encoding="ascii")
    (folder / "drive.inc").write_text(_drive(problem, loading, modes), encoding="ascii")
    with as_file(deck_source() / DECK) as source:
        shutil.copyfile(source, folder / DECK)
    return loading


def deck_source() -> Traversable:
    """Folder of the plain decks: inside the installed package, or at the top of a checkout."""
    packed = files("pipeline") / "lammps_inputs"
    return packed if packed.is_dir() else Path(__file__).resolve().parents[2] / "lammps_inputs"


def _settings(problem: Problem, loading: Loading, stretch: int) -> str:
    radius = problem.particles.radius
    values = {
        "kinematics": problem.kinematics.value,
        "rotation": "off" if shear_stiffness(problem) is None else "on",
        "cmod_max": f"{problem.cmod_max:.17g}",
        # never-deleted bonds stretch by the crack opening: partners must stay within the ghost cutoff
        "cutoff": f"{6 * radius + 2 * problem.cmod_max:.9g}",
        "skin": f"{2 * radius:.9g}",
        "record": str(loading.record),
        "steps_max": str(loading.steps_max),
        "stretch": str(loading.record * -(-stretch // loading.record)),
    }
    return "".join(f"variable {name} index {value}\n" for name, value in values.items())


def _coefficients(table: LawTable) -> str:
    lines = ["# type k_n (N/m) f_max (N) delta_max (m) options; inf: takes no damage"]
    for k, (words, name) in enumerate(zip(table.coefficients, table.name, strict=True), 1):
        lines.append(f"bond_coeff {k} {words}  # {name}")
    return "\n".join(lines) + "\n"


def _attachments(problem: Problem) -> str:
    """Weights of grips and gauge as custom properties of the particles."""
    weights = {grip.name: (grip.index, grip.weight) for grip in problem.grips}
    weights["gauge"] = (problem.gauge.index, problem.gauge.weight)
    lines = ["fix weights all property/atom " + " ".join(f"d_{name}" for name in weights)]
    for name, (index, weight) in weights.items():
        lines += [f"set atom {i + 1} d_{name} {w:.17g}" for i, w in zip(index, weight, strict=True) if w != 0]
    return "\n".join(lines) + "\n"


def _drive(problem: Problem, loading: Loading, modes: Modes) -> str:
    words = [
        "fix drive all cohesive/drive",
        "gauge gauge",
        *(_grip(grip) for grip in problem.grips),
        f"cmod {problem.cmod_max:.17g}",
        f"record {loading.record}",
        f"omega {modes.omega:.17g}",
        f"lag {loading.lag:.17g}",
        f"load {loading.first_load:.17g}",
        f"rate {loading.first_rate:.17g} {loading.lowest_rate:.17g} {loading.highest_rate:.17g}",
        f"frames {len(problem.stations)} " + " ".join(f"{s:.17g}" for s in problem.stations),
        *([] if problem.clock is None else [_clock(problem.clock)]),
    ]
    return " &\n  ".join(words) + "\n"


def _clock(clock: Clock) -> str:
    pairs = zip(clock.cmod, clock.time, strict=True)
    return f"clock {clock.cmod.size} " + " ".join(f"{c:.17g} {t:.17g}" for c, t in pairs)


def _grip(grip: Grip) -> str:
    x, y = grip.direction
    return f"grip {grip.name} {x:.17g} {y:.17g} {grip.drive:.17g} {grip.role}"
