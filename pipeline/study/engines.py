"""The engines by name."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from pipeline import __version__
from pipeline.core.errors import InputError, UnavailableError
from pipeline.core.problem import Problem, Solution
from pipeline.study.opening_rate import solve_at_rates

REFINED = "equilibrium, refined"  # for the cross-check: much nearer to the limit than what it is to judge
FORWARD = "equilibrium, machine forward"  # the same, and jumps where the explicit engines must jump
RULE = 2  # of loading the explicit engines: simulations by another one are not taken for these
FINER = 4  # increments of these are shorter
TIGHTER = 0.1  # of the tolerance


@dataclass(frozen=True)
class Engine:
    """A solver and the label under which its solutions are kept.

    Laws that depend on the rate of opening are followed by any of them (`study.opening_rate`).

    Parameters
    ----------
    label : str; name and versions: solutions of another version are not taken for these
    solve : Problem → Solution, picklable
    expectation : Problem → what a run will cost, in words; None where there is nothing to warn of
    """

    label: str
    solve: Callable[[Problem], Solution]
    expectation: Callable[[Problem], str] | None = None


def engine(name: str, ranks: int = 1) -> Engine:
    """The engine of that name.

    Parameters
    ----------
    name : str
    ranks : int; MPI ranks of one simulation, of LAMMPS only. Its solutions are kept under the same label: they
        differ by the order of sums alone

    Raises
    ------
    UnavailableError
        for an engine that this version does not have
    InputError
        for ranks of an engine that has none
    """
    bare = _at_constant_rate(name, ranks)
    return replace(bare, solve=partial(solve_at_rates, solve=bare.solve))


def _at_constant_rate(name: str, ranks: int) -> Engine:
    """The engine itself, which knows no rate of opening."""
    if ranks > 1 and name != "lammps":
        raise InputError(f"ranks = {ranks}: engine {name} runs in one process, leave --ranks out or use lammps")
    if name == "lammps":
        from pipeline.lmp import plugin, simulate
        from pipeline.lmp.ranks import launcher, solve_on_ranks

        plugin.library()  # refuses before any work is done
        version = importlib.metadata.version("lammps")
        label = f"lammps {version}, loading rule {RULE}, cohesive-bpm {__version__}"
        if ranks == 1:
            return Engine(label, simulate.solve)
        launcher()
        return Engine(label, partial(solve_on_ranks, ranks=ranks))
    if name == "equilibrium":
        from pipeline.equilibrium import solve

        return Engine(f"equilibrium to {solve.TOLERANCE:g}, cohesive-bpm {__version__}", solve.solve)
    if name in (REFINED, FORWARD):
        return _refined(name)
    if name == "reference":
        from pipeline.reference import solve as steps

        label = f"reference, loading rule {RULE}, cohesive-bpm {__version__}"
        return Engine(label, steps.solve, steps.expectation)
    raise UnavailableError(
        f"engine {name!r} is not available in version {__version__}: use lammps, equilibrium or reference"
    )


def _refined(name: str) -> Engine:
    """The equilibrium engine with shorter increments and a tighter tolerance."""
    from pipeline.equilibrium import solve
    from pipeline.equilibrium.path import Increments

    usual, tolerance = Increments(), TIGHTER * solve.TOLERANCE
    shorter = replace(usual, far=usual.far / FINER, near=usual.near / FINER, leap=usual.leap / FINER)
    label = f"{name} to {tolerance:g}, increments 1/{FINER}, cohesive-bpm {__version__}"
    solver = partial(solve.solve, tolerance=tolerance, increments=shorter, snap_back=name == REFINED)
    return Engine(label, solver)
