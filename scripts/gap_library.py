"""Makes the library of discrepancies that `diagnose` judges by: python scripts/gap_library.py OUT --specimens 20"""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.study.batch import Batch
from pipeline.study.gap_library import make_library
from pipeline.terminal import Display


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder for tests and simulations; a stopped run goes on in it")
    parser.add_argument("--file", type=Path, default=Path("pipeline/gap/library.json"))
    parser.add_argument("--specimens", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=9000)
    parser.add_argument("--radius-mm", type=float, default=1.0)
    parser.add_argument("--geometry", default="seb")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    seeds = range(asked.first_seed, asked.first_seed + asked.specimens)
    with Display() as progress:
        batch = Batch(asked.out, asked.geometry, asked.radius_mm, progress)
        told = make_library(batch, asked.file, seeds, asked.workers)
    print(told)


if __name__ == "__main__":
    main()
