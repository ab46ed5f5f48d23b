"""The library of effects: every file here that defines an effect belongs to it."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

from pipeline.core.errors import InputError
from pipeline.gap.effect import Effect


@cache
def library() -> dict[str, Effect]:
    """Name → effect, in the order of their names."""
    found = {}
    for module in pkgutil.iter_modules(__path__):
        content = importlib.import_module(f"{__name__}.{module.name}")
        for _, kind in inspect.getmembers(content, inspect.isclass):
            if kind.__module__ == content.__name__ and issubclass(kind, Effect):
                found[kind.name] = kind()
    return dict(sorted(found.items()))


def effect(name: str) -> Effect:
    """The effect of that name.

    Raises
    ------
    InputError
        where there is none
    """
    if name not in library():
        raise InputError(f"there is no effect {name!r}: it must be one of {', '.join(library())}")
    return library()[name]


def checked(name: str, value: float) -> float:
    """The value, where it lies in the plausible range of its effect; refused elsewhere."""
    size = effect(name).magnitude
    if not size.low <= value <= size.high:
        raise InputError(
            f"{name} = {value:g} lies outside its plausible range, {size.low:g} to {size.high:g} (unit {size.unit})"
        )
    return value
