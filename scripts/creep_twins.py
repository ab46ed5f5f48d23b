"""Identify creeping virtual tests with and without creep and print the table of docs/accuracy.md.

usage: python scripts/creep_twins.py OUT [--geometries seb,dct] [--seeds 1,2,3,4,5] [--radius-mm 0.6]
       [--objective both] [--engine lammps] [--no-elastic] [--workers N]
Finished simulations are kept in OUT: the same call goes on where it stopped.
"""

import argparse
from pathlib import Path

from pipeline.study.creep_twins import creep_twins, twin_table
from pipeline.terminal import Display

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--geometries", default="seb,dct")
    parser.add_argument("--seeds", default="1,2,3,4,5")
    parser.add_argument("--radius-mm", type=float, default=0.6)
    parser.add_argument("--objective", default="both")
    parser.add_argument("--engine", default="lammps")
    parser.add_argument("--no-elastic", dest="elastic", action="store_false", help="fit with creep only")
    parser.add_argument("--workers", type=int)
    given = parser.parse_args()
    how = {name: getattr(given, name) for name in ("radius_mm", "objective", "engine", "elastic", "workers")}
    seeds = [int(seed) for seed in given.seeds.split(",")]
    with Display() as progress:
        found = list(creep_twins(given.out, given.geometries.split(","), seeds, progress=progress, **how))
    print(twin_table(found))
