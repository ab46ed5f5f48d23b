"""LAMMPS against the equilibrium engine: three sections and mastic alone, rows along and across the crack.

usage: python scripts/compare_engines.py seb|dct RADIUS_MM [ACCURACIES, as in 0.03,0.01,0.003] [creeping]
"""

import sys

from pipeline.study.creep_trials import MASTIC
from pipeline.study.engine_tables import engine_rows
from pipeline.study.specimens import section_trial

if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "creeping"]
    if len(given) not in (2, 3):
        sys.exit(__doc__)
    geometry, radius, mastic = given[0], float(given[1]), MASTIC if "creeping" in sys.argv else None
    accuracies = [float(a) for a in (given[2] if len(given) == 3 else "0.03,0.01,0.003").split(",")]
    angles = (90.0, 0.0) if mastic is None else (90.0,)
    trials = [section_trial(geometry, radius, s, angle, mastic=mastic) for angle in angles for s in (1, 2, 3, None)]
    for row in engine_rows(trials, accuracies):
        print(row, flush=True)
