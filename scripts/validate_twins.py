"""Identify virtual tests of several seeds and print the table of docs/accuracy.md.

usage: python scripts/validate_twins.py OUT [--seeds 1,2,3,4,5] [--radius-mm 0.6] [--objective both]
       [--same-lattice] [--config SETTINGS.toml]
Finished simulations are kept in OUT: the same call goes on where it stopped.
"""

import argparse
from pathlib import Path

from pipeline.study.trials import same_lattice_trial, trial_table, twin_trial
from pipeline.terminal import Display

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", default="1,2,3,4,5")
    parser.add_argument("--radius-mm", type=float, default=0.6)
    parser.add_argument("--objective", default="both")
    parser.add_argument("--same-lattice", action="store_true", help="break the identifying lattice itself")
    parser.add_argument("--config", type=Path, help="settings of identify")
    given = parser.parse_args()
    trial = same_lattice_trial if given.same_lattice else twin_trial
    with Display() as progress:
        trials = [
            trial(given.out, int(seed), given.objective, progress, config=given.config, radius_mm=given.radius_mm)
            for seed in given.seeds.split(",")
        ]
    print(trial_table(trials))
