"""From material to bond: what a straight cut through the lattice carries, counted, beside the closed forms.

usage: python scripts/material_to_bond.py
"""

from pipeline.study.parting import parting_table

if __name__ == "__main__":
    print(parting_table(), end="")
