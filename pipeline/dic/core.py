"""The compiled core, or one sentence on how to get it."""

from __future__ import annotations

import importlib
from types import ModuleType

from pipeline.core.errors import ToolchainError


def core() -> ModuleType:
    """The compiled module ``pipeline.dic._correlate``.

    Raises
    ------
    ToolchainError
        if it was not built for this Python
    """
    try:
        return importlib.import_module("pipeline.dic._correlate")
    except ImportError as error:
        raise ToolchainError(
            f"the compiled core of the image correlation cannot be loaded ({error}): install the package with "
            "`pip install .`, or build it in place with `cmake -S pipeline/dic/cpp -B build && cmake --build build`"
        ) from error
