"""Simulate SE(B) and DC(T) at the paper's parameters for several inputs that it does not state; print the table.

usage: python scripts/paper_table.py OUT [--seeds 1,2,3,4,5] [--moduli 8,10,12] [--shares 0.45] [--spans 92,110,130]
       [--radius-mm 0.6] [--engine lammps] [--workers N]
Finished simulations are kept in OUT: the same call goes on where it stopped.
"""

import argparse
from itertools import product
from pathlib import Path

from pipeline.study.paper_table import Unknowns, paper_rows, paper_table, spans_that_match
from pipeline.terminal import Display


def numbers(text: str) -> list[float]:
    return [float(part) for part in text.split(",")]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=numbers, default=[1, 2, 3, 4, 5])
    parser.add_argument("--moduli", type=numbers, default=[8, 10, 12])
    parser.add_argument("--shares", type=numbers, default=[0.45])
    parser.add_argument("--spans", type=numbers, default=[92, 110, 130])
    parser.add_argument("--radius-mm", type=float, default=0.6)
    parser.add_argument("--engine", default="lammps")
    parser.add_argument("--workers", type=int)
    given = parser.parse_args()
    unknowns = [Unknowns(*known) for known in product(given.moduli, given.shares, given.spans)]
    seeds = [int(seed) for seed in given.seeds]
    with Display() as progress:
        how = {name: getattr(given, name) for name in ("radius_mm", "engine", "workers")}
        rows = paper_rows(given.out, unknowns, seeds, progress=progress, **how)
    print(paper_table(rows), spans_that_match(rows), sep="\n")
