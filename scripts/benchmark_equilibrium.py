"""The equilibrium engine: against itself ten times tighter and whole; time and memory as particles get smaller.

usage: python scripts/benchmark_equilibrium.py tolerance seb|dct RADIUS_MM
       python scripts/benchmark_equilibrium.py size seb|dct [RADII in mm, large to small, as in 1.2,0.6,0.3]
"""

import sys

from pipeline.study.engine_tables import size_rows, tolerance_rows
from pipeline.study.specimens import section_trial

if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("tolerance", "size"):
        sys.exit(__doc__)
    what, geometry, numbers = sys.argv[1], sys.argv[2], (sys.argv[3] if len(sys.argv) > 3 else "1.2,0.6,0.3")
    radii = [float(r) for r in numbers.split(",")]
    if what == "size":
        rows = size_rows(geometry, radii)
    else:
        rows = tolerance_rows([section_trial(geometry, radii[0], seed) for seed in (1, None)])
    for row in rows:
        print(row, flush=True)
