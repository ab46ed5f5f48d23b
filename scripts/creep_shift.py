"""Fit creeping specimens with and without creep; print by how much the elastic fit takes f_max too large.

usage: python scripts/creep_shift.py OUT [--geometries seb,dct] [--seeds 1,2,3,4] [--radius-mm 1.2] [--objective fields]
       [--engine lammps] [--faster 1] [--workers N]
Finished simulations are kept in OUT: the same call goes on where it stopped.
"""

import argparse
from pathlib import Path

from pipeline.study.creep_trials import creep_table, creep_trials
from pipeline.terminal import Display

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--geometries", default="seb,dct")
    parser.add_argument("--seeds", default="1,2,3,4")
    parser.add_argument("--radius-mm", type=float, default=1.2)
    parser.add_argument("--objective", default="fields")
    parser.add_argument("--engine", default="lammps", help="of the test and of the fit")
    parser.add_argument("--faster", type=float, default=1.0, help="factor on the usual rate of opening")
    parser.add_argument("--workers", type=int)
    given = parser.parse_args()
    seeds = [int(seed) for seed in given.seeds.split(",")]
    how = {name: getattr(given, name) for name in ("radius_mm", "objective", "engine", "faster", "workers")}
    with Display() as progress:
        trials = creep_trials(given.out, given.geometries.split(","), seeds, progress=progress, **how)
    print(creep_table(trials))
