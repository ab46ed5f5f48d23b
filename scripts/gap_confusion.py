"""Makes the confusion table of the diagnosis: python scripts/gap_confusion.py OUT --specimens 4 --free 16"""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.study.batch import Batch
from pipeline.study.gap_confusion import TIMES, confusion
from pipeline.terminal import Display


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the trials; a stopped run goes on in it")
    parser.add_argument("--file", type=Path, default=Path("pipeline/gap/library.json"))
    parser.add_argument("--specimens", type=int, default=4, help="that carry effects, and none")
    parser.add_argument("--free", type=int, default=16, help="further ones that carry none")
    parser.add_argument("--first-seed", type=int, default=9200)
    parser.add_argument("--effects", nargs="*", default=(), help="all by default")
    parser.add_argument("--times", nargs="*", type=float, default=TIMES, help="detection limits")
    parser.add_argument("--radius-mm", type=float, default=1.0)
    asked = parser.parse_args()
    middle = asked.first_seed + asked.specimens
    with Display() as progress:
        told = confusion(
            Batch(asked.out, radius_mm=asked.radius_mm, progress=progress),
            asked.file,
            range(asked.first_seed, middle),
            free=range(middle, middle + asked.free),
            names=asked.effects,
            times=asked.times,
        )
    print(told)


if __name__ == "__main__":
    main()
