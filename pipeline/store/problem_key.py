"""The address of a simulation: a digest of everything its result depends on."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from itertools import chain
from typing import Any

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.problem import Problem

VERSION = "1"  # of this encoding; a change makes every stored simulation unknown


def problem_key(problem: Problem, engine: str) -> str:
    """SHA-256 (64 hexadecimal digits) of a problem and of the engine that solves it.

    Every field of the problem counts: specimen, particles, bonds, law, grips, gauge, kinematics, end,
    stations, accuracy. Classes count by name, numbers by value (not by width), arrays by shape and values,
    so the key is the same in every process and on every machine.

    Parameters
    ----------
    problem : Problem
    engine : str; name and version, with every setting of the engine that is not in the problem

    Raises
    ------
    InputError
        where the problem holds an object whose content is unknown
    """
    digest = hashlib.sha256(VERSION.encode())
    for piece in chain(_pieces(engine, "engine"), _pieces(problem, "problem")):
        digest.update(piece)
    return digest.hexdigest()


def _pieces(value: Any, place: str) -> Iterator[bytes]:
    """The bytes of a value, each kind under its own tag and with its length, so that none can be mistaken."""
    if isinstance(value, Enum):
        yield from _pieces((type(value).__name__, value.value), place)
    elif value is None or isinstance(value, bool | np.bool_):
        yield b"b" + repr(None if value is None else bool(value)).encode()
    elif isinstance(value, int | float | np.number):
        yield b"n" + struct.pack("<d", float(value) + 0.0)  # + 0.0: minus zero is zero
    elif isinstance(value, str):
        yield _tagged(b"s", value.encode())
    elif isinstance(value, np.ndarray):
        yield from _array_pieces(value, place)
    elif isinstance(value, tuple | list):
        yield b"t" + struct.pack("<q", len(value))
        for index, item in enumerate(value):
            yield from _pieces(item, f"{place}[{index}]")
    elif is_dataclass(value) and not isinstance(value, type):
        yield _tagged(b"c", type(value).__name__.encode())
        for field in sorted(fields(value), key=lambda f: f.name):
            yield _tagged(b"f", field.name.encode())
            yield from _pieces(getattr(value, field.name), f"{place}.{field.name}")
    else:
        raise InputError(
            f"{place} is a {type(value).__name__}: only frozen dataclasses, arrays and numbers can be keyed"
        )


def _array_pieces(array: np.ndarray, place: str) -> Iterator[bytes]:
    """Shape and values of an array, all numbers as little-endian doubles."""
    if array.dtype.kind not in "biuf":
        raise InputError(f"{place} is an array of {array.dtype}: only numbers can be keyed")
    yield b"a" + struct.pack(f"<{array.ndim + 1}q", array.ndim, *array.shape)
    yield (np.ascontiguousarray(array, "<f8") + 0.0).tobytes()


def _tagged(tag: bytes, content: bytes) -> bytes:
    return tag + struct.pack("<q", len(content)) + content
