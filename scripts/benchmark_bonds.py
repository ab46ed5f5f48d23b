"""Steps per second of bond_style cohesive beside the bond styles of LAMMPS, 36,300 particles on one core, in turns.

usage: python scripts/benchmark_bonds.py [ROUNDS]
"""

import sys

from pipeline.study.bond_speed import bond_speed_table, bond_speeds

if __name__ == "__main__":
    print(bond_speed_table(bond_speeds(int(sys.argv[1]) if len(sys.argv) > 1 else 7)))
