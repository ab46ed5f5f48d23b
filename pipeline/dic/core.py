"""The compiled core, or one sentence on how to get it."""

from __future__ import annotations

from types import ModuleType

from pipeline.core.errors import ToolchainError
from pipeline.dic import interface
from pipeline.dic.library import library


def core() -> ModuleType:
    """The module `pipeline.dic.interface`, its library loaded.

    Raises
    ------
    ToolchainError
        if the library was not built, or was built from other sources
    """
    try:
        library()
    except OSError as error:
        raise ToolchainError(
            f"the compiled core of the image correlation cannot be loaded ({error}): install the package with "
            "`pip install .`, or build it in the checkout with `cmake -S . -B build && cmake --build build && "
            "cmake --install build --prefix .`"
        ) from error
    return interface
