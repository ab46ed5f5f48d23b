#!/usr/bin/env python3
"""Write the creep record that ships with the package: three temperatures of a made-up mastic, 1 % noise."""

import sys
from pathlib import Path

import numpy as np

from pipeline.core.units import GPA
from pipeline.materials.kelvin_chain import KelvinChain
from pipeline.materials.shift_laws import Wlf
from pipeline.store.atomic import write_atomically

MASTIC = KelvinChain(5e-11, 1e-14, np.geomspace(0.1, 3, 8) * 1e-10, np.geomspace(0.03, 3e4, 8))  # at -12 °C
LAW = Wlf(15.0, 120.0, 261.15)
READINGS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # s, AASHTO T 322
LEVELS = np.array([-24.0, -12.0, 0.0])  # °C
NOISE = 0.01

if __name__ == "__main__":
    file = Path(sys.argv[1] if len(sys.argv) > 1 else "pipeline/examples/creep/isotherms.csv")
    random = np.random.default_rng(2017)
    titles = ["Time (s)", *(f"D at {level:g} °C (1/GPa)" for level in LEVELS)]
    lines = ["made up by scripts/make_creep_example.py", ";".join(titles)]
    for time in READINGS:
        exact = MASTIC.creep_compliance(time / 10 ** LAW.log_shift(LEVELS + 273.15)) * GPA
        read = exact * np.exp(NOISE * random.normal(size=LEVELS.size))
        lines.append(";".join([f"{time:g}", *(f"{value:.4g}".replace(".", ",") for value in read)]))
    write_atomically(file, ("\n".join(lines) + "\n").encode())
    print(file)
