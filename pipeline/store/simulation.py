"""Simulations on disk: one file each, found by what was simulated."""

from __future__ import annotations

import contextlib
import logging
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from pipeline.core.curve import LoadCurve
from pipeline.core.errors import MissingFileError, StoreError
from pipeline.core.problem import EnergyBalance, Solution
from pipeline.store.atomic import SUFFIX, refused, write_atomically
from pipeline.store.layouts import SIMULATION

log = logging.getLogger("pipeline.store")


class Store(Protocol):
    """Where solutions are kept, by the key of `problem_key`."""

    def get(self, key: str) -> Solution | None: ...
    def put(self, key: str, solution: Solution) -> None: ...
    def keys(self) -> tuple[str, ...]: ...
    def __contains__(self, key: str) -> bool: ...


class MemoryStore:
    """Solutions kept in memory; answers exactly as `SimulationStore` does."""

    def __init__(self) -> None:
        self._held: dict[str, dict[str, Any]] = {}

    def get(self, key: str) -> Solution | None:
        """The solution, None where there is none."""
        return to_solution(self._held[key]) if key in self._held else None

    def put(self, key: str, solution: Solution) -> None:
        """Keep a solution; displacements are rounded to single precision, as on disk."""
        values = from_solution(key, solution)
        rounded = np.asarray(values["displacement_m"], np.float32).copy()
        self._held[key] = values | {"displacement_m": rounded}

    def keys(self) -> tuple[str, ...]:
        """Keys of all solutions, sorted."""
        return tuple(sorted(self._held))

    def __contains__(self, key: str) -> bool:
        return key in self._held


class SimulationStore:
    """Solutions in a folder, one HDF5 file each (layout `SIMULATION`), named by its key.

    A file is whole or not there. One that cannot be trusted (truncated, bits changed, of another key or
    format) is moved aside as `*.damaged`, named in a warning and in `damaged`, and counts as absent, so
    that only its simulation runs again.

    Parameters
    ----------
    folder : Path; made if it does not exist
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        self.damaged: list[Path] = []
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise refused(self.folder, error) from error

    def path(self, key: str) -> Path:
        """The file of a key."""
        return self.folder / f"{key}.h5"

    def get(self, key: str) -> Solution | None:
        """The solution, None where there is none that can be trusted."""
        try:
            values = SIMULATION.decode(self.path(key))
        except MissingFileError:
            return None
        except StoreError as error:
            self._set_aside(key, str(error))
            return None
        if values["key"] != key:
            self._set_aside(key, f"{key}.h5: holds another simulation, {values['key']}")
            return None
        return to_solution(values)

    def put(self, key: str, solution: Solution) -> None:
        """Keep a solution; raises StoreError where it cannot be written, other files stay as they are."""
        write_atomically(self.path(key), SIMULATION.encode(from_solution(key, solution)))

    def keys(self) -> tuple[str, ...]:
        """Keys of all files, sorted, whether or not they can be trusted."""
        return tuple(sorted(path.stem for path in self.folder.glob("*.h5")))

    def __contains__(self, key: str) -> bool:
        return self.get(key) is not None

    def sweep(self) -> int:
        """Remove what killed runs left half written; returns how many. Only while nobody else writes here."""
        left = list(self.folder.glob(f".*{SUFFIX}"))
        for path in left:
            path.unlink(missing_ok=True)
        return len(left)

    def _set_aside(self, key: str, reason: str) -> None:
        """Move a file out of the way under a name that is still free."""
        path, count = self.path(key), 0
        aside = path.with_name(f"{path.name}.damaged")
        while aside.exists():
            count += 1
            aside = path.with_name(f"{path.name}.damaged-{count}")
        with contextlib.suppress(FileNotFoundError):  # another process was quicker
            path.rename(aside)
        self.damaged.append(aside)
        log.warning("%s. Moved to %s; this simulation will run again", reason, aside.name)


def from_solution(key: str, solution: Solution) -> dict[str, Any]:
    """Values of a solution by the names of the layout."""
    energy, curve = solution.energy, solution.curve
    return {
        "key": key,
        "engine": solution.engine,
        "message": solution.message,
        "converged": solution.converged,
        "steps": solution.steps,
        "seconds": solution.seconds,
        "quasi_static_error": solution.quasi_static_error,
        **{f"{name}_j": value for name, value in vars(energy).items()},
        "curve/time_s": curve.time,
        "curve/cmod_m": curve.cmod,
        "curve/load_n": curve.load,
        "curve/load_line_m": curve.load_line,
        "curve/load_std_n": curve.load_std,
        "cmod_m": solution.cmod,
        "displacement_m": solution.displacement,
        "reached_m": solution.reached,
    }


def to_solution(values: dict[str, Any]) -> Solution:
    """The solution from values by the names of the layout."""
    names = {"time": "time_s", "cmod": "cmod_m", "load": "load_n", "load_line": "load_line_m", "load_std": "load_std_n"}
    energies = ("external", "stored", "dissipated", "kinetic", "damping")
    plain = ("engine", "message", "converged", "steps", "seconds", "quasi_static_error")
    return Solution(
        curve=LoadCurve(**{name: values[f"curve/{stored}"] for name, stored in names.items()}),
        cmod=values["cmod_m"],
        displacement=np.asarray(values["displacement_m"], float),
        reached=values["reached_m"],
        energy=EnergyBalance(**{name: values[f"{name}_j"] for name in energies}),
        **{name: values[name] for name in plain},
    )
