"""Stock approximations: linear softening by bond styles of LAMMPS, for machines where ours cannot be compiled.

Both have the peak force f_max and the energy f_max delta_max/2 of a bond. `table` follows the force–opening line itself
but forgets: a bond that closes again heals. `plastic` remembers, but its force stays at f_max until it parts at
(delta_max + delta_peak)/2, it yields in compression too, and pairs that push must keep the specimen from flowing.
"""

from __future__ import annotations

import shutil
import time
from importlib.resources import as_file
from pathlib import Path

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import ConvergenceError, UnavailableError
from pipeline.core.problem import EnergyBalance, Grip, Problem, Role, Solution
from pipeline.explicit.frames import fields_at_stations
from pipeline.explicit.modes import Modes, lowest_modes, masses
from pipeline.lmp import ranks
from pipeline.lmp.data_file import write_data_file
from pipeline.lmp.deck import deck_source
from pipeline.lmp.law_table import LawTable, law_table
from pipeline.lmp.output import read_curve, read_frames, read_stretched
from pipeline.lmp.simulate import in_folder
from pipeline.materials.cohesive import LinearSoftening

STOCK_DECK = "stock.lmp"
KINDS = ("table", "plastic")
PERIODS = 200  # of the lowest mode, in which the undamaged specimen would be opened to the end at 1 %
DRAG = 1.0  # times the lowest mode
RECORD = 20
SPRING = 0.3  # omega² of a grip's spring on its patch, beside at most 3.24 of the lattice: 4 is unstable
CONTACT = 0.2  # plastic: stiffness of pairs that push, of the softest bond's
BINS = 100_000  # table
WHOLE = 0.5  # strain that no bond reaches: those that take no damage yield and part there


def write_stock_deck(folder: Path, problem: Problem, stretch: int = 0, *, kind: str = "table") -> None:
    """Write a folder in which `lmp -in stock.lmp` runs the problem with bonds of LAMMPS.

    Parameters
    ----------
    folder : Path
    problem : Problem
    stretch : int; steps from one restart file to the next, 0: none
    kind : str; of `KINDS`

    Raises
    ------
    UnavailableError
        for another law than linear softening with secant unloading
    """
    _linear(problem)
    table, modes, mass = law_table(problem), lowest_modes(problem), masses(problem)
    speed = problem.cmod_max / modes.cmod / (PERIODS * 0.01 / problem.accuracy * 2 * np.pi / modes.omega)
    write_data_file(folder / "specimen.data", problem, table, speed * modes.response)
    rows = "".join(f"{i} {m:.17g}\n" for i, m in enumerate(mass, 1))
    (folder / "masses.txt").write_text(f"# mass of every particle\n{len(mass)}\n{rows}", encoding="ascii")
    (folder / "settings.inc").write_text(_settings(problem, modes, mass, speed, stretch), encoding="ascii")
    length = 2 * problem.particles.radius
    if kind == "table":
        (folder / "bonds.table").write_text(bond_tables(table, length, 3 * problem.cmod_max), encoding="ascii")
    text = _tabulated(table) if kind == "table" else _plastic(problem, table, length)
    (folder / "bonds.inc").write_text(text, encoding="ascii")
    (folder / "grips.inc").write_text(_grips(problem, mass), encoding="ascii")
    with as_file(deck_source() / STOCK_DECK) as source:
        shutil.copyfile(source, folder / STOCK_DECK)


def _linear(problem: Problem) -> LinearSoftening:
    if not isinstance(problem.law, LinearSoftening):
        told = f"the stock approximation stands in for LinearSoftening only, not for {type(problem.law).__name__}"
        raise UnavailableError(f"{told}: export without --stock, or take softening = 'linear' and no shear")
    return problem.law


def bond_tables(table: LawTable, length: float, widest: float) -> str:
    """Force–length tables of all kinds of bonds, for `bond_style table`.

    Parameters
    ----------
    table : LawTable
    length : float, m; of an unstretched bond
    widest : float, m; largest opening
    """
    parts = []
    for k, row in enumerate(table.rows, 1):
        k_n, f_max, delta_max = row[:3]
        peak, end = (f_max / k_n, delta_max) if np.isfinite(f_max) else (widest / 4, widest)
        opening = np.array([-0.2 * length, 0.0, peak, end, max(widest, 2 * end)])
        force = np.array([k_n * opening[0], 0.0, k_n * peak, 0.0, 0.0])
        if np.isinf(f_max):
            force = k_n * opening
        # LAMMPS lays a spline through the rows: close around the peak, and none nearly twice
        marks = ((opening[0], 0.0, 800), (0.0, 2 * peak, 200), (2 * peak, float(opening[-1]), 3000))
        grid = np.concatenate([*(np.linspace(a, b, n, endpoint=False) for a, b, n in marks), opening[-1:]])
        tension = np.interp(grid, opening, force)
        energy = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (tension[1:] + tension[:-1]) / 2)])
        energy -= np.interp(0.0, grid, energy)
        rows = zip(range(1, grid.size + 1), length + grid, energy, -tension, strict=True)
        body = "".join(f"{i} {r:.17g} {e:.17g} {f:.17g}\n" for i, r, e, f in rows)
        parts.append(f"KIND{k}\nN {grid.size} EQ {length:.17g}\n\n{body}\n")
    return "# length (m), energy (J), repulsive force (N)\n\n" + "".join(parts)


def _tabulated(table: LawTable) -> str:
    lines = [f"bond_style table linear {BINS}", "pair_style none", "compute bonds all bond/local dist dist dist"]
    lines += [f"bond_coeff {k} bonds.table KIND{k}  # {name}" for k, name in enumerate(table.name, 1)]
    return "\n".join(lines) + "\n"


def _plastic(problem: Problem, table: LawTable, length: float) -> str:
    contact = CONTACT * float(problem.law.k_n.min())
    lines = [
        "special_bonds lj/coul 1 1 1  # pairs push when they are closer than at first, bonded or not",
        'if "${begin} == 0" then "bond_style bpm/spring/plastic overlay/pair yes smooth no"',
        f"pair_style bpm/spring\npair_coeff * * {contact:.9g} {length:.17g} 0.0",
        "compute bonds all bond/local dist b1 b2",
        "# bond_coeff: type k_n (N/m), strain of parting, damping, strain of yielding",
    ]
    for k, (row, name) in enumerate(zip(table.rows, table.name, strict=True), 1):
        k_n, f_max, delta_max = row[:3]
        peak, end = f_max / k_n, (delta_max + f_max / k_n) / 2
        part, give = (end / length, peak / length) if np.isfinite(f_max) else (WHOLE, WHOLE)
        lines.append(f"bond_coeff {k} {k_n:.17g} {part:.17g} 0.0 {give:.17g}  # {name}")
    return "\n".join(lines) + "\n"


def _settings(problem: Problem, modes: Modes, mass: np.ndarray, speed: float, stretch: int) -> str:
    radius = problem.particles.radius
    stone = problem.particles.phase == 2
    typical = [float(np.median(mass[side])) if side.any() else 1.0 for side in (~stone, stone)]
    values = {
        "cmod_max": f"{problem.cmod_max:.17g}",
        "station": " ".join(f"{s:.17g}" for s in (*problem.stations, problem.cmod_max)),
        "speed": f"{speed:.17g}",
        "drag": f"{DRAG * modes.omega * typical[0]:.9g}",
        "drag_aggregate": f"{typical[1] / typical[0]:.9g}",
        "cutoff": f"{6 * radius + 2 * problem.cmod_max:.9g}",
        "skin": f"{2 * radius:.9g}",
        "record": str(RECORD),
        "steps_max": str(int(4 * problem.cmod_max / modes.cmod / speed)),
        "stretch": str(RECORD * -(-stretch // RECORD)),
    }
    return "".join(f"variable {name} index {value}\n" for name, value in values.items())


def _grips(problem: Problem, mass: np.ndarray) -> str:
    weights = {grip.name: (grip.index, grip.weight) for grip in problem.grips}
    weights["gauge"] = (problem.gauge.index, problem.gauge.weight)
    lines = ["fix weights all property/atom " + " ".join(f"d_{name}" for name in weights)]
    for name, (index, weight) in weights.items():
        held = [(i + 1, w) for i, w in zip(index.tolist(), weight.tolist(), strict=True) if w != 0]
        lines += [f"set atom {i} d_{name} {w:.17g}" for i, w in held]
        lines.append(f"group g_{name} id " + " ".join(str(i) for i, _ in held))
    for grip in problem.grips:
        lines += _grip(problem, grip, mass)
    of = {role: [g.name for g in problem.grips if g.role is role] for role in Role}
    lines += [f"variable {role.value} equal " + ("+".join(f"v_r_{n}" for n in of[role]) or "0") for role in Role]
    [moved] = of[Role.DRIVE]
    start = float(problem.gauge.weight @ problem.particles.position[problem.gauge.index, 0])
    lines += [
        f"variable moved equal v_at_{moved}",
        "variable xg atom d_gauge*x",
        "compute gauge g_gauge reduce sum v_xg",
        f"variable cmod equal c_gauge-({start:.17g})",
    ]
    return "\n".join(lines) + "\n"


def _grip(problem: Problem, grip: Grip, mass: np.ndarray) -> list[str]:
    """A spring that pulls the weighted mean of a patch to where the machine has it, with the same weights."""
    (dx, dy), name = grip.direction, grip.name
    stiffness = SPRING / float(np.sum(grip.weight**2 / mass[grip.index]))
    start = float(grip.weight @ (problem.particles.position[grip.index] @ grip.direction))
    return [
        f"variable u_{name} atom d_{name}*(({dx:.17g})*x+({dy:.17g})*y)",
        f"compute u_{name} g_{name} reduce sum v_u_{name}",
        f"variable at_{name} equal c_u_{name}-({start:.17g})",
        f"variable r_{name} equal {stiffness:.17g}*(({grip.drive:.17g})*v_line-v_at_{name})",
        f"variable x_{name} atom v_r_{name}*d_{name}*({dx:.17g})",
        f"variable y_{name} atom v_r_{name}*d_{name}*({dy:.17g})",
        f"fix f_{name} g_{name} addforce v_x_{name} v_y_{name} 0.0",
    ]


def solve_stock(problem: Problem, folder: Path | None = None, *, kind: str = "table") -> Solution:
    """Run a stock approximation by the `lmp` of the wheel; arguments and errors as of `simulate.solve`."""
    return in_folder(folder, lambda place: _solve_in(problem, place, kind))


def _solve_in(problem: Problem, folder: Path, kind: str) -> Solution:
    start = time.monotonic()
    write_stock_deck(folder, problem, kind=kind)
    ranks.run(folder, 1, deck=STOCK_DECK)
    return read_stock_solution(problem, folder, time.monotonic() - start)


def read_stock_solution(problem: Problem, folder: Path, seconds: float) -> Solution:
    """The solution from the files of a finished run; a bond that has parted counts as opened to delta_max.

    Drag, yielding in compression and what healed are not measured: they stand in the error of the energy balance.
    """
    curve = read_curve(folder / "curve.txt")
    cmod, line = curve["cmod_m"], curve["load_line_m"]
    if cmod[-1] < problem.cmod_max:
        raise ConvergenceError(
            f"the gauge stopped at {cmod[-1] * 1e3:.4g} mm of {problem.cmod_max * 1e3:.4g} mm after "
            f"{curve['step'][-1]:.0f} steps: ask for a smaller cmod_max_mm"
        )
    stations, displacement = fields_at_stations(problem, read_frames(folder / "frames.dump", problem.particles.count))
    law, (opening, reached) = _linear(problem), _openings(problem, folder)
    energy = EnergyBalance(
        external=float(np.trapezoid(curve["drive_n"], line)),
        stored=float(law.stored(opening, reached).sum()),
        dissipated=float(law.dissipated(reached).sum()),
        kinetic=float(curve["kinetic_j"][-1]),
    )
    return Solution(
        curve=LoadCurve(cmod / problem.cmod_rate, cmod, curve["load_n"], line),
        cmod=stations,
        displacement=displacement,
        reached=reached,
        energy=energy,
        quasi_static_error=float("nan"),
        steps=int(curve["step"][-1]),
        seconds=seconds,
        engine="lammps stock",
        converged=True,
        message=f"the gauge reached {problem.cmod_max * 1e3:.4g} mm",
    )


def _openings(problem: Problem, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Opening (m,) and largest opening (m,) in m of each bond, as its style knows them."""
    law, found = _linear(problem), read_stretched(folder / "bonds.dump", problem.bonds.pairs)
    length, _ = problem.bonds.reference(problem.particles.position)
    opening = np.where(np.isnan(found[:, 0]), law.delta_max, found[:, 0] - length)
    reached = np.clip(opening, 0, None)
    if not (folder / "bonds.table").exists():  # plastic: what stays of the opening, and where it has parted
        lasting = np.where(np.isnan(found[:, 0]), law.delta_max, found[:, 2] - found[:, 1] + law.delta_peak)
        reached = np.where(lasting > law.delta_peak, lasting, reached)
    return opening, np.where(np.isfinite(law.f_max), reached, 0.0)
