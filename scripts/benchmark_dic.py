"""Measure the image correlation: `python scripts/benchmark_dic.py [--scenes N] [--frames N] [--data FOLDER]`."""

import argparse
import itertools
import subprocess
import sys
import time
from pathlib import Path

PAIR = "from pipeline.dic.speckle import smooth_pair; pair = smooth_pair(100)"
MATCH = "from pipeline.dic.correlate import correlate; correlate(pair.reference, pair.deformed)"
DATA = Path(__file__).parents[2] / "shared" / "data"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=60, help="cracks drawn at random")
    parser.add_argument("--frames", type=int, default=200, help="of 1300 × 1000 px in the series")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of measured and challenge images")
    given = parser.parse_args()
    from pipeline.dic import benchmark, challenge, trials
    from pipeline.store.images import read_grey

    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", f"{PAIR}; {MATCH}"], check=True)
    seconds = time.perf_counter() - begin
    start = benchmark.Row("first result after the start, s", seconds, "≤ 3", seconds <= 3)
    parts = [[start], benchmark.pairs(), benchmark.random_cracks(given.scenes), benchmark.double_cracks()]
    parts += [trials.large_motion(), trials.light(), trials.series(given.frames)]
    parts += [challenge.challenge(given.data, read_grey)] if given.data.is_dir() else []
    met = True
    for row in itertools.chain(*parts):
        print(row, flush=True)
        met &= row.met is not False
    return int(not met)


if __name__ == "__main__":
    sys.exit(main())
