"""The equilibrium engine: against itself tighter and whole; time and memory by particle size; small and finite.

usage: python scripts/benchmark_equilibrium.py tolerance seb|dct RADIUS_MM
       python scripts/benchmark_equilibrium.py size seb|dct [RADII in mm, large to small, as in 1.2,0.6,0.3]
       python scripts/benchmark_equilibrium.py kinematics seb|dct RADIUS_MM
"""

import sys

from pipeline.study.engine_tables import kinematics_rows, size_rows, tolerance_rows
from pipeline.study.specimens import section_trial

if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("tolerance", "size", "kinematics"):
        sys.exit(__doc__)
    what, geometry, numbers = sys.argv[1], sys.argv[2], (sys.argv[3] if len(sys.argv) > 3 else "1.2,0.6,0.3")
    radii = [float(r) for r in numbers.split(",")]
    if what == "size":
        rows = size_rows(geometry, radii)
    else:
        table = tolerance_rows if what == "tolerance" else kinematics_rows
        rows = table([section_trial(geometry, radii[0], seed) for seed in (1, None)])
    for row in rows:
        print(row, flush=True)
