"""Cholesky factors of stiffnesses, many of one pattern, by the compiled library beside this file.

It eliminates groups of variables by dense operations (multifrontal: Duff & Reid 1983), five times as fast as SciPy's
SuperLU and three times in the solutions; SuperLU serves where the library was not built.
"""

from __future__ import annotations

import ctypes
import weakref
from ctypes import c_double, c_int32, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.ctypeslib import ndpointer
from scipy import sparse
from scipy.linalg import cython_blas

VERSION = 2  # CHOLESKY_INTERFACE
SMALLEST = {4: 1e-6, 8: 1e-12}  # by bytes a number: pivots are raised to this share of the diagonal entry

_DOUBLES, _INTS = (ndpointer(kind, flags="C_CONTIGUOUS") for kind in ("f8", "i4"))
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "cholesky_new_plan": (c_void_p, (c_int64, _INTS, _INTS, c_void_p)),
    "cholesky_free_plan": (None, (c_void_p,)),
    "cholesky_new_factor": (c_void_p, (c_void_p, _DOUBLES, c_double, c_int32)),
    "cholesky_free_factor": (None, (c_void_p,)),
    "cholesky_raised": (c_int64, (c_void_p,)),
    "cholesky_last": (None, (c_void_p, c_int64, _DOUBLES)),
    "cholesky_solve": (c_int32, (c_void_p, _DOUBLES, c_int64)),
}
_BLAS = ("sgemm", "ssyrk", "strsm", "dgemm", "dsyrk", "dtrsm")


class Plan:
    """How matrices of one pattern are factorised: what is found once.

    Parameters
    ----------
    pattern : (q, q) csc array, both halves and all of the diagonal stored; its variables in a good order of elimination

    Raises
    ------
    ValueError
        if the pattern is not symmetric, or its rows do not ascend
    """

    def __init__(self, pattern: sparse.csc_array):
        mirrored = pattern.T.tocsc()
        if not all(np.array_equal(getattr(pattern, part), getattr(mirrored, part)) for part in ("indptr", "indices")):
            raise ValueError("the pattern is not symmetric, or its rows do not ascend")
        self.entries, self.size = pattern.nnz, pattern.shape[0]
        self.library = _library()
        start, row = (np.ascontiguousarray(part, np.int32) for part in (pattern.indptr, pattern.indices))
        routines = (c_void_p * len(_BLAS))(*map(_routine, _BLAS))
        self.address = self.library.cholesky_new_plan(self.size, start, row, routines)
        if not self.address:
            raise MemoryError("no factorisation was planned: too little memory, or a diagonal entry is missing")
        weakref.finalize(self, self.library.cholesky_free_plan, self.address)

    def factor(self, matrix: sparse.csc_array, single: bool) -> Factor:
        """The factor of a positive definite matrix of this pattern, in single or in double precision."""
        if matrix.nnz != self.entries or matrix.shape[0] != self.size:
            raise ValueError("the matrix has another pattern than the plan")
        return Factor(self, matrix.data, 4 if single else 8)


class Factor:
    """A factorised matrix; `raised` of its pivots were too small, or negative, out of round-off."""

    def __init__(self, plan: Plan, value: np.ndarray, number: int):
        self.plan = plan  # must outlive this
        value = np.ascontiguousarray(value, float)
        self.address = plan.library.cholesky_new_factor(plan.address, value, SMALLEST[number], number)
        if not self.address:
            raise MemoryError("too little memory for a factorisation")
        weakref.finalize(self, plan.library.cholesky_free_factor, self.address)
        self.raised = int(plan.library.cholesky_raised(self.address))

    def last(self, count: int) -> np.ndarray:
        """The last block (count, count) of the lower triangle L, K = L Lᵀ."""
        if not 0 <= count <= self.plan.size:
            raise ValueError(f"the factor has {self.plan.size} rows, {count} are asked for")
        block = np.empty((count, count))
        self.plan.library.cholesky_last(self.address, count, block)
        return block

    def solve(self, right: np.ndarray) -> np.ndarray:
        """K⁻¹ b of right-hand sides (q,) or (q, k)."""
        side = np.array(right, float, order="C")
        if len(side) != self.plan.size:
            raise ValueError(f"a right-hand side has {self.plan.size} entries, got {len(side)}")
        if side.size and self.plan.library.cholesky_solve(self.address, side, side.size // len(side)):
            raise MemoryError("too little memory for a solution")
        return side


def whole_factor(matrix: sparse.csc_array) -> Factor:
    """The factor of one matrix, in double precision; its variables in a good order of elimination."""
    even = sparse.csc_array(0.5 * (matrix + matrix.T))  # what cancels may be stored in one half only
    even.sort_indices()
    return Plan(even).factor(even, single=False)


@cache
def available() -> bool:
    """Whether the library was built."""
    try:
        _library()
    except OSError:
        return False
    return True


@cache
def _library() -> ctypes.CDLL:
    """The library beside this file, loaded once; OSError if it is not there or has another interface."""
    path = Path(__file__).with_name("libcholesky.so")
    loaded = ctypes.CDLL(str(path))
    version = int(loaded.cholesky_interface())
    if version != VERSION:
        raise OSError(f"{path}: has interface {version}, {VERSION} is needed")
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    return loaded


def _routine(name: str) -> int:
    """Address of a routine of the BLAS that SciPy brings."""
    capsule, api = cython_blas.__pyx_capi__[name], ctypes.pythonapi  # as SciPy lends them to compiled code
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, (ctypes.py_object,)
    api.PyCapsule_GetPointer.restype, api.PyCapsule_GetPointer.argtypes = c_void_p, (ctypes.py_object, ctypes.c_char_p)
    return api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule))
