"""Processor time of one SE(B) and one DC(T) in LAMMPS at several radii, with the accuracy each run reports itself.

usage: python scripts/benchmark_lammps.py [RADII in mm, as in 1.2,0.6,0.3]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from pipeline.core.units import MM
from pipeline.lmp.simulate import solve
from pipeline.store.bundle import read_bundle
from pipeline.store.new import write_bundle
from pipeline.store.start import start_parameters
from pipeline.study.assembly import build_model
from pipeline.study.request import Request
from pipeline.study.virtual_test import prepare

CMOD = {"seb": 0.55 * MM, "dct": 0.6 * MM}

if __name__ == "__main__":
    radii = [float(r) for r in (sys.argv[1] if len(sys.argv) > 1 else "1.2,0.6,0.3").split(",")]
    print("| test | radius | particles | steps | seconds | ms per step | own error | energy error |")
    print("|---|---|---|---|---|---|---|---|")
    for geometry in ("seb", "dct"):
        with tempfile.TemporaryDirectory() as folder:
            write_bundle(Path(folder), *prepare(Request(geometry), geometry, np.random.default_rng(1)))
            bundle = read_bundle(Path(folder))
            for radius in radii:
                problem = build_model(bundle, radius * MM).problem(*start_parameters(bundle), cmod_max=CMOD[geometry])
                run = solve(problem)
                print(
                    f"| {geometry} | {radius:g} mm | {problem.particles.count} | {run.steps} | {run.seconds:.1f} | "
                    f"{1e3 * run.seconds / run.steps:.3f} | {run.quasi_static_error:.2%} | {run.energy.error:.0e} |"
                )
