"""Reference values of bond_style cohesive in the form of LAMMPS' own tests (unittest/force-styles).

usage: python tests/lmp/force_styles/regenerate.py     writes bond-cohesive*.yaml beside itself
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.lmp.plugin import open_lammps

HERE = Path(__file__).resolve().parent
PLAIN = "1 3.7e8 71.0 1.14e-4"
CASES = {
    "bond-cohesive": ("cohesive kinematics small", PLAIN, "nve"),
    "bond-cohesive-finite": ("cohesive kinematics finite", f"{PLAIN} softening exponential", "nve"),
    "bond-cohesive-shear": (
        "cohesive kinematics small",
        f"{PLAIN} shear 1e8 50.0 1.5e-4 softening bilinear-tail 1.0 unloading elastic friction 0.4",
        "cohesive/nve radius 3e-4",
    ),
    "bond-cohesive-relax": ("cohesive kinematics small", "1 3.7e8 2000.0 1.14e-4 relax 2 0.35 1e-6 0.6 4e-5", "nve"),
}
# the bonds are unstretched where they are first seen: so run, then move the particles
MOVE = """run 0 post no
displace_atoms all ramp x 0.0 4e-6 x 0.0 1.2e-3 units box
displace_atoms all random 2e-7 2e-7 0.0 48279 units box
velocity all ramp vx 0.0 0.5 x 0.0 1.2e-3 units box"""
STEPS = 4


def values(style: str, coefficients: str, integrator: str) -> dict[str, Any]:
    """Energy, stress and forces at the start and after a few steps."""
    lmp = open_lammps()
    try:
        lmp.file(str(HERE / "in.cohesive"))
        lmp.commands_string(f"bond_style {style}\nbond_coeff {coefficients}\nfix move all {integrator}\n{MOVE}")
        lmp.commands_string(
            "compute stress all pressure NULL virial\nthermo_style custom step pe c_stress[*]\nrun 0 post no"
        )
        found = {"natoms": lmp.get_natoms(), **_now(lmp, "init")}
        lmp.command(f"run {STEPS} post no")
        return found | _now(lmp, "run")
    finally:
        lmp.close()


def _now(lmp: Any, when: str) -> dict[str, Any]:
    order = np.argsort(lmp.numpy.extract_atom("id")[: lmp.get_natoms()])
    volume = lmp.get_thermo("vol")
    return {
        f"{when}_energy": lmp.get_thermo("pe"),
        f"{when}_stress": lmp.numpy.extract_compute("stress", 0, 1) * volume,
        f"{when}_forces": lmp.numpy.extract_atom("f")[order].copy(),
    }


def text(name: str, style: str, coefficients: str, integrator: str, found: dict[str, Any]) -> str:
    """One YAML file."""
    forces = {
        key: "\n".join(f"  {i:3d} {x:23.16e} {y:23.16e} {z:23.16e}" for i, (x, y, z) in enumerate(found[key], 1))
        for key in ("init_forces", "run_forces")
    }
    stress = {key: " ".join(f"{v:.16e}" for v in found[key]) for key in ("init_stress", "run_stress")}
    post = "\n".join("  " + line for line in f"fix move all {integrator}\n{MOVE}".splitlines())
    return f"""---
lammps_version: 22 Jul 2025
epsilon: 1e-11
skip_tests: intel gpu kokkos_omp
prerequisites: ! |
  atom bond
  bond cohesive
pre_commands: ! ""
post_commands: ! |
{post}
input_file: in.cohesive
bond_style: {style}
bond_coeff: ! |
  {coefficients}
equilibrium: 1 0
extract: ! ""
natoms: {found["natoms"]}
init_energy: {found["init_energy"]:.16e}
init_stress: ! |2-
  {stress["init_stress"]}
init_forces: ! |2
{forces["init_forces"]}
run_energy: {found["run_energy"]:.16e}
run_stress: ! |2-
  {stress["run_stress"]}
run_forces: ! |2
{forces["run_forces"]}
...
"""


if __name__ == "__main__":
    for name, case in CASES.items():
        (HERE / f"{name}.yaml").write_text(text(name, *case, values(*case)), encoding="ascii")
