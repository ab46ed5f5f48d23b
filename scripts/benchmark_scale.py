"""Cost of a step of LAMMPS against particles and ranks, as ratios of neighbours in one run.
usage: python scripts/benchmark_scale.py [RADII in mm, as in 1.2,0.6,0.3] [RANKS, as in 1,2] [STEPS at 0.3 mm]
"""

import math
import re
import sys
import tempfile
from pathlib import Path

from pipeline.explicit.modes import lowest_modes
from pipeline.lmp import ranks
from pipeline.lmp.deck import DECK, write_deck
from pipeline.study.specimens import section_trial


def seconds(folder: Path, count: int, steps: int) -> float:
    """Time of one step on that many ranks, from the loop time in the log."""
    deck = re.sub(r"run +(\$\{steps_max\} upto|\d+)\n", f"run {steps}\n", (folder / DECK).read_text())
    (folder / DECK).write_text(deck)
    ranks.run(folder, count)
    return float(re.findall(r"Loop time of (\S+)", (folder / "log.lammps").read_text())[0]) / steps


if __name__ == "__main__":
    radii, counts, steps = [*sys.argv[1:], *("1.2,0.6,0.3", "1,2", "2000")[len(sys.argv) - 1 :]]
    print(
        "| radius | particles | ranks | µs a step | ns a bond and step | over one rank | steps of the lowest period |"
    )
    print("|---|---|---|---|---|---|---|")
    for radius in radii.split(","):
        problem, one = section_trial("seb", float(radius), 1).problem, 0.0
        period = round(2 * math.pi / lowest_modes(problem).omega)
        with tempfile.TemporaryDirectory() as name:
            write_deck(Path(name), problem)
            for count in map(int, counts.split(",")):
                each = seconds(Path(name), count, int(steps) * 26400 // problem.particles.count)
                one = one or each
                cost = f"{1e6 * each:.0f} | {1e9 * each / problem.bonds.count:.2f} | {one / each:.2f}× | {period}"
                print(f"| {radius} mm | {problem.particles.count} | {count} | {cost} |", flush=True)
