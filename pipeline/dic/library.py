"""The compiled library: its records and functions as cpp/interface.h declares them, loaded and called by ctypes.

The interpreter is free for other threads while a call runs.
"""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_double, c_float, c_int32, c_int64
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.ctypeslib import ndpointer

from pipeline.core.errors import InputError

VERSION = 3  # DIC_INTERFACE
_TEXT = 256  # DIC_TEXT
_ERRORS: dict[int, type[Exception]] = {1: InputError, 2: MemoryError}

MATCHED = np.dtype(
    [
        *(("warp", "f8", 6), ("zncc", "f8"), ("residual", "f8"), ("level", "f8", 2), ("covariance", "f8", 3)),
        *(("contrast", "f8"), ("score", "f8"), ("bend", "f8"), ("suspect", "f8", 4)),
        *(("outcome", "i4"), ("iterations", "i4"), ("count", "i4")),
    ],
    align=True,
)
PARTED = np.dtype(
    [
        *(("near", "f8", 6), ("far", "f8", 6), ("line", "f8", 2), ("margin", "f8"), ("cost", "f8", 3)),
        *(("near_fit", "f8", 5), ("far_fit", "f8", 5), ("near_covariance", "f8", 36), ("far_covariance", "f8", 36)),
        *(("attempted", "i4"), ("far_matched", "i4"), ("count", "i4", 2), ("iterations", "i4")),
    ],
    align=True,
)


class SettingsStruct(ctypes.Structure):
    _fields_ = (
        *(("half", c_int32), ("model", c_int32), ("max_iterations", c_int32), ("threads", c_int32)),
        *(("tolerance", c_double), ("wander", c_double), ("accept", c_double)),
    )


class PictureStruct(ctypes.Structure):
    """Known to the library only."""


class PatternStruct(ctypes.Structure):
    """Known to the library only."""


def _array(kind: Any, *, optional: bool = False) -> Any:
    """The argument type of an array without gaps, or of None where it is optional."""
    pointer: Any = ndpointer(kind, flags="C_CONTIGUOUS")
    if not optional:
        return pointer

    def from_param(cls: Any, value: Any) -> Any:
        return None if value is None else pointer.from_param(value)

    return type("optional", (pointer,), {"from_param": classmethod(from_param)})


_DOUBLES, _MAYBE, _FLOATS, _INTS = _array("f8"), _array("f8", optional=True), _array("f4"), _array("i4")
_PAIR = (POINTER(PictureStruct), POINTER(PictureStruct), _DOUBLES, c_int64)
_CHECKED: dict[str, tuple[Any, ...]] = {
    "dic_new_picture": (_FLOATS, c_int64, c_int64, c_float, c_float, POINTER(POINTER(PictureStruct))),
    "dic_new_pattern": (_DOUBLES, c_int64, POINTER(POINTER(PatternStruct))),
    "dic_evaluate": (POINTER(PatternStruct), _DOUBLES, c_int64, c_int32, _FLOATS),
    "dic_propagate": (*_PAIR, _INTS, _INTS, _DOUBLES, c_int64, _MAYBE, POINTER(SettingsStruct), _array(MATCHED)),
    "dic_match": (*_PAIR, _DOUBLES, _MAYBE, POINTER(SettingsStruct), _array(MATCHED)),
    "dic_split": (
        *(*_PAIR, _DOUBLES, c_int64, _INTS, c_double, _MAYBE, _MAYBE, _MAYBE),
        *(POINTER(SettingsStruct), _array(PARTED)),
    ),
    "dic_cover": (_DOUBLES, c_int64, _INTS, c_int64, c_double, c_double, c_double, c_int32, c_int32, _INTS),
}
_FREEING = {"dic_free_picture": POINTER(PictureStruct), "dic_free_pattern": POINTER(PatternStruct)}


@cache
def library() -> ctypes.CDLL:
    """The library beside this file, loaded once.

    Raises
    ------
    OSError
        if it is not there, cannot be loaded or has another interface than this file
    """
    path = Path(__file__).with_name("libcorrelate.so")
    loaded = ctypes.CDLL(str(path))
    version = int(loaded.dic_interface())
    if version != VERSION:
        raise OSError(f"{path}: has interface {version}, {VERSION} is needed")
    for name, arguments in _CHECKED.items():
        getattr(loaded, name).argtypes = (*arguments, ctypes.c_char_p)
    for name, owned in _FREEING.items():
        getattr(loaded, name).argtypes, getattr(loaded, name).restype = (owned,), None
    return loaded


def call(name: str, *arguments: Any) -> None:
    """Call a function of the library; what it says of a failure is raised."""
    text = ctypes.create_string_buffer(_TEXT)
    outcome = getattr(library(), name)(*arguments, text)
    if outcome:
        raise _ERRORS.get(outcome, RuntimeError)(text.value.decode())
