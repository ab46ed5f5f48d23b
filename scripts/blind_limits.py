"""Makes the detection limits that scale the blind check's effects: python scripts/blind_limits.py OUT --specimens 6"""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.study.batch import Batch
from pipeline.study.blind_check.limits import FIRST_SEED, make_limits
from pipeline.terminal import Display


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of tests and simulations; a stopped run goes on in it")
    parser.add_argument("--file", type=Path, default=Path("pipeline/study/blind_check/limits.json"))
    parser.add_argument("--specimens", type=int, default=6)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--radius-mm", type=float, default=1.0)
    parser.add_argument("--geometry", default="seb")
    asked = parser.parse_args()
    seeds = range(asked.first_seed, asked.first_seed + asked.specimens)
    with Display() as progress:
        told = make_limits(Batch(asked.out, asked.geometry, asked.radius_mm, progress), asked.file, seeds)
    print(told)


if __name__ == "__main__":
    main()
