"""What stock approximations cost against the cohesive law: curve, field, energy, time; one accuracy asked of all.

usage: python scripts/benchmark_stock.py [RADIUS in mm] [ACCURACY]
"""

import sys

import numpy as np

from pipeline.core.units import MM
from pipeline.lmp.simulate import solve
from pipeline.lmp.stock import KINDS, solve_stock
from pipeline.study.agreement import curve_difference, field_difference, peak_difference
from pipeline.study.observation import observe_solution
from pipeline.study.specimens import section_trial

if __name__ == "__main__":
    radius, accuracy = (float(word) for word in [*sys.argv[1:], *("1.2", "0.01")[len(sys.argv) - 1 :]])
    print("| specimen | bonds | peak load | load–CMOD | field | work | used up by bonds | steps | seconds |")
    print("|---|---|---|---|---|---|---|---|---|")
    for geometry, seed in (("seb", None), ("seb", 1), ("dct", 1)):
        trial = section_trial(geometry, radius, seed).with_accuracy(accuracy)
        problem, ours = trial.problem, solve(trial.problem)
        cmod = np.linspace(0.02 * MM, 0.98 * problem.cmod_max, 100)
        seen = observe_solution(problem, ours, trial.points)
        one = [
            f"{ours.curve.peak()[1]:.0f} N",
            "",
            "",
            f"{ours.energy.external:.3f} J",
            f"{ours.energy.dissipated:.3f} J",
        ]
        print(f"| {trial.name} | cohesive | {' | '.join(one)} | {ours.steps} | {ours.seconds:.1f} |", flush=True)
        for kind in KINDS:
            run = solve_stock(problem, kind=kind)
            apart = field_difference(observe_solution(problem, run, trial.points), seen)
            ratios = (run.energy.external / ours.energy.external, run.energy.dissipated / ours.energy.dissipated)
            cells = [f"{peak_difference(run, ours):+.1%}", f"{curve_difference(run.curve, ours.curve, cmod):.1%}"]
            cells += [f"{apart:.1%}", *(f"{ratio - 1:+.1%}" for ratio in ratios)]
            print(f"| | {kind} | {' | '.join(cells)} | {run.steps} | {run.seconds:.1f} |", flush=True)
