"""The engines by name."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass

from pipeline import __version__
from pipeline.core.errors import UnavailableError
from pipeline.core.problem import Problem, Solution


@dataclass(frozen=True)
class Engine:
    """A solver and the label under which its solutions are kept.

    Parameters
    ----------
    label : str; name and versions: solutions of another version are not taken for these
    solve : Problem → Solution, picklable
    expectation : Problem → what a run will cost, in words; None where there is nothing to warn of
    """

    label: str
    solve: Callable[[Problem], Solution]
    expectation: Callable[[Problem], str] | None = None


def engine(name: str) -> Engine:
    """The engine of that name.

    Raises
    ------
    UnavailableError
        for an engine that this version does not have
    """
    if name == "lammps":
        from pipeline.lmp import plugin, simulate

        plugin.library()  # refuses before any work is done
        version = importlib.metadata.version("lammps")
        return Engine(f"lammps {version}, cohesive-bpm {__version__}", simulate.solve)
    if name == "equilibrium":
        from pipeline.equilibrium import solve

        return Engine(f"equilibrium to {solve.TOLERANCE:g}, cohesive-bpm {__version__}", solve.solve)
    if name == "reference":
        from pipeline.reference import solve as steps

        return Engine(f"reference, cohesive-bpm {__version__}", steps.solve, steps.expectation)
    raise UnavailableError(
        f"engine {name!r} is not available in version {__version__}: use lammps, equilibrium or reference"
    )
