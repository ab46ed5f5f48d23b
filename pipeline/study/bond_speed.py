"""Steps per second of bond_style cohesive beside the bond styles that LAMMPS has."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from pipeline.lmp.plugin import open_lammps

K = 3.7e8
PREPARE = """
units si
dimension 2
boundary f f p
atom_style {atom}
atom_modify map array sort 0 0
newton on {newton}
timestep 1e-8
lattice hex 6e-4
region box block 0 150 0 121 -0.5 0.5
create_box 1 box bond/types 1 extra/bond/per/atom 6 extra/special/per/atom 12
create_atoms 1 box
{mass}
comm_modify vel yes cutoff 2e-3
neighbor 6e-4 bin
neigh_modify every 100 delay 0 check yes
special_bonds lj 0.0 1.0 1.0 coul 0.0 1.0 1.0
pair_style zero 7e-4 nocoeff
pair_coeff * *
bond_style zero
bond_coeff *
create_bonds many all all 1 5.9e-4 6.1e-4
"""
BPM = "special_bonds lj 0.0 1.0 1.0 coul 1.0 1.0 1.0\npair_style zero 7e-4 nocoeff\npair_coeff * *\n"
RUN = """velocity all ramp vx 0 0.01 x 0 0.09
fix move all {integrator}
fix plane all enforce2d
thermo 0
run 20 post no"""
COHESIVE = f"bond_coeff 1 {K} 71 1.14e-4"
TURNING = f"{COHESIVE} shear 1e8 71 1.14e-4"
STYLES = {
    "no bonds' forces": ("pair_style none\nbond_style zero\nbond_coeff *", "nve"),
    "harmonic": (f"pair_style none\nbond_style harmonic\nbond_coeff 1 {K / 2} 6e-4", "nve"),
    "bpm/spring": (f"{BPM}bond_style bpm/spring\nbond_coeff 1 {K} 0.5 0.0", "nve"),
    "bpm/spring/plastic": (f"{BPM}bond_style bpm/spring/plastic\nbond_coeff 1 {K} 0.5 0.0 0.4", "nve"),
    "bpm/rotational": (
        f"{BPM}bond_style bpm/rotational\nbond_coeff 1 {K} {K / 3} 1 1 1e6 1e6 1e6 1e6 0 0 0 0",
        "nve/bpm/sphere disc",
    ),
    "cohesive, small": (f"pair_style none\nbond_style cohesive kinematics small\n{COHESIVE}", "nve"),
    "cohesive, finite": (f"pair_style none\nbond_style cohesive kinematics finite\n{COHESIVE}", "nve"),
    "cohesive, small, turning": (
        f"pair_style none\nbond_style cohesive kinematics small\n{TURNING}",
        "cohesive/nve radius 3e-4",
    ),
    "cohesive, finite, turning": (
        f"pair_style none\nbond_style cohesive kinematics finite\n{TURNING}",
        "cohesive/nve radius 3e-4",
    ),
}


YADE = """
import time
radius = 3e-4
concrete = CpmMat(young=1e10, poisson=0.25, frictionAngle=0.8, density=2000, sigmaT=5e6, epsCrackOnset=1e-4,
                  relDuctility=600, isoPrestress=0)
O.materials.append(concrete)
for row in range(242):
    for column in range(150):
        x = radius * (2 * column + row % 2)
        O.bodies.append(utils.sphere((x, 3**0.5 * radius * row, 0), radius, material=concrete))
        O.bodies[-1].state.blockedDOFs = "zXY"
        O.bodies[-1].state.vel = (x / 9, 0, 0)
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(aabbEnlargeFactor=1.5, label="boxes")], verletDist=0.2 * radius),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom(interactionDetectionFactor=1.5, label="pairs")],
        [Ip2_CpmMat_CpmMat_CpmPhys(cohesiveThresholdIter=10)],
        [Law2_ScGeom_CpmPhys_Cpm()],
    ),
    NewtonIntegrator(damping=0),
]
O.dt = 1e-8
O.step()
boxes.aabbEnlargeFactor = pairs.interactionDetectionFactor = -1
O.run(20, True)
start = time.process_time()
O.run(60, True)
print("seconds a step", (time.process_time() - start) / 60)
"""
"""The concrete model of YADE on the same lattice, in the plane with one rotation, on one thread."""


def yade_seconds() -> float | None:
    """Seconds a step of YADE's concrete model (CPM); None where it is not installed."""
    program = shutil.which("yade")
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "cpm.py"
        script.write_text(YADE, "utf-8")
        ended = subprocess.run([program, "-n", "-x", "-j1", script], cwd=folder, capture_output=True, text=True)
    told = [line for line in ended.stdout.splitlines() if line.startswith("seconds a step")]
    return float(told[0].split()[-1]) if told else None


def instance(name: str) -> Any:
    """A lattice of 36,300 particles and 108,117 bonds that moves."""
    bonds, integrator = STYLES[name]
    sphere = "bpm/sphere" if name == "bpm/rotational" else "bond"
    mass = "set group all density 2000 diameter 6e-4" if sphere != "bond" else "mass 1 1e-6"
    lmp = open_lammps()
    lmp.commands_string(PREPARE.format(atom=sphere, newton="off" if name.startswith("bpm") else "on", mass=mass))
    lmp.commands_string(bonds + "\n" + RUN.format(integrator=integrator))
    return lmp


def bond_speeds(rounds: int) -> dict[str, float]:
    """Seconds a step of every style on 36,300 particles, the best of some rounds in which all take turns."""
    running = {name: instance(name) for name in STYLES}
    best = dict.fromkeys(STYLES, float("inf"))
    for _ in range(rounds):
        for name, lmp in running.items():
            steps = 8 if name == "bpm/rotational" else 60
            start = time.process_time()
            lmp.command(f"run {steps} pre no post no")
            best[name] = min(best[name], (time.process_time() - start) / steps)
    concrete = yade_seconds()
    return best if concrete is None else best | {"YADE, CPM": concrete}


def bond_speed_table(best: dict[str, float]) -> str:
    """Speeds as a Markdown table, with the ratios to two stock styles."""
    rows = ["| bonds | steps/s | ms per step | against bpm/spring | against bpm/rotational |", "|---|---|---|---|---|"]
    for name, seconds in best.items():
        spring, rotational = (best[other] / seconds for other in ("bpm/spring", "bpm/rotational"))
        rows.append(f"| {name} | {1 / seconds:.0f} | {1e3 * seconds:.3f} | {spring:.2f} | {rotational:.1f} |")
    return "\n".join(rows) + "\n"
