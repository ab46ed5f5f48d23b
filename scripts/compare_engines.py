"""LAMMPS against the equilibrium engine: three sections and mastic alone, rows along and across the crack.

usage: python scripts/compare_engines.py seb|dct RADIUS_MM [ACCURACIES, as in 0.03,0.01,0.003]
"""

import sys

from pipeline.study.engine_tables import engine_rows
from pipeline.study.specimens import section_trial

if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    geometry, radius = sys.argv[1], float(sys.argv[2])
    accuracies = [float(a) for a in (sys.argv[3] if len(sys.argv) == 4 else "0.03,0.01,0.003").split(",")]
    trials = [section_trial(geometry, radius, seed, angle) for angle in (90.0, 0.0) for seed in (1, 2, 3, None)]
    for row in engine_rows(trials, accuracies):
        print(row, flush=True)
