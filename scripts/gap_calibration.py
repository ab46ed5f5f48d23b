"""Fits the temperature of the library of discrepancies: python scripts/gap_calibration.py OUT LEARNT --specimens 12"""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.study.batch import Batch
from pipeline.study.gap_calibration import calibrate
from pipeline.terminal import Display


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the trials; a stopped run goes on in it")
    parser.add_argument("learnt", type=Path, help="folder that the library was made in")
    parser.add_argument("--file", type=Path, default=Path("pipeline/gap/library.json"))
    parser.add_argument("--specimens", type=int, default=12)
    parser.add_argument("--first-seed", type=int, default=9100)
    parser.add_argument("--effects", type=int, default=6, help="tests with an effect for every specimen")
    parser.add_argument("--geometry", default="seb")
    parser.add_argument("--radius-mm", type=float, default=1.0)
    asked = parser.parse_args()
    seeds = range(asked.first_seed, asked.first_seed + asked.specimens)
    with Display() as progress:
        batch = Batch(asked.out, asked.geometry, asked.radius_mm, progress)
        told = calibrate(batch, asked.file, asked.learnt, seeds, asked.effects)
    print(told)


if __name__ == "__main__":
    main()
