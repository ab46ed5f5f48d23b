"""Creep and work of fracture against literature and laboratory: prints the tables of docs/accuracy.md.

usage: python scripts/validate_creep.py DATA [--trials N]   (DATA: the folder of measured data)
"""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.study import creep_validation as check


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--trials", type=int, default=200)
    given = parser.parse_args()
    for title, rows in (
        ("interconversion", check.interconversions(given.data / "asphalt_viscomodule")),
        ("coverage of 95 % intervals", check.coverages(given.trials)),
        ("binder sweep", check.binder(given.data / "fhwa_asphalt")),
        ("DENT energies", check.dent(given.data / "fhwa_asphalt")),
    ):
        print(f"{title}\n")
        for row in rows:
            print(f"| {' | '.join(row)} |")
        print()


if __name__ == "__main__":
    main()
