"""L-BFGS with a preconditioner that majorises the potential (Nocedal & Wright 2006, ch. 7)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg.blas import daxpy

MEMORY = 8  # pairs of steps kept; twelve need as many iterations, six a few more


class Preconditioner(Protocol):
    """An approximation of the inverse Hessian that can be renewed at a point."""

    def solve(self, gradient: np.ndarray) -> np.ndarray: ...
    def renew(self, at: np.ndarray) -> None: ...


@dataclass(frozen=True)
class Minimum:
    """Where a minimisation ended.

    Parameters
    ----------
    at : (q,) array
    gradient : (q,) array there, free of the force of the constraint
    residual : float; largest entry of `gradient`
    step : (q,) array; the next step the minimiser would have taken, its estimate of the error
    multiplier : float; force of the constraint, 0 without one
    iterations : int
    converged : bool
    """

    at: np.ndarray
    gradient: np.ndarray
    residual: float
    step: np.ndarray
    multiplier: float
    iterations: int
    converged: bool


class _Curvature:
    """The last pairs of steps and changes of gradient, and the inverse Hessian they imply."""

    def __init__(self, solve: Callable[[np.ndarray], np.ndarray]):
        self.pairs: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=MEMORY)
        self.solve = solve

    def learn(self, step: np.ndarray, change: np.ndarray) -> None:
        """Keep a pair unless it shows negative or vanishing curvature."""
        product = float(step @ change)
        if product > 1e-10 * np.linalg.norm(step) * np.linalg.norm(change):
            self.pairs.append((step, change, 1 / product))

    def descent(self, gradient: np.ndarray) -> np.ndarray:
        """−H⁻¹ g by the two-loop recursion, steepest in the preconditioner's metric if that is not downhill."""
        v, shares = gradient.copy(), []
        for step, change, scale in reversed(self.pairs):
            shares.append(scale * (step @ v))
            v = daxpy(change, v, a=-shares[-1])
        v = self.solve(v)
        for (step, change, scale), share in zip(self.pairs, reversed(shares), strict=True):
            v = daxpy(step, v, a=share - scale * (change @ v))
        if v @ gradient > 0:
            return -v
        self.pairs.clear()
        return -self.solve(gradient)


def minimise(
    gradient: Callable[[np.ndarray], np.ndarray],
    preconditioner: Preconditioner,
    start: np.ndarray,
    tolerance: float,
    constraint: np.ndarray | None = None,
    limit: int = 400,
    patience: int = 25,
    reach: float = np.inf,
) -> Minimum:
    """Go downhill from `start` until no entry of the gradient exceeds `tolerance`.

    The secant stiffness of a softening bond lies above its curvature everywhere (the energy is concave in
    δ²: half-quadratic minimisation, Geman & Reynolds 1992), so that a full preconditioned step goes
    downhill; L-BFGS learns the rest. The line search uses derivatives only: near convergence the
    differences of energy drown in round-off, those of the gradient do not.

    Parameters
    ----------
    gradient : function of (q,) → (q,)
    preconditioner : Preconditioner, renewed every `patience` iterations
    start : (q,) array
    tolerance : float, in units of the gradient
    constraint : (q,) array, optional; its product with q stays what it is at `start`
    limit : int; iterations after which to give up
    reach : float; how far one step may change an entry before its length is searched
    """
    project = _Projection(preconditioner, constraint)
    curvature = _Curvature(project.solve)
    at, slope = start, gradient(start)
    for iteration in range(limit + 1):
        free, multiplier = project.split(slope)
        residual = float(np.abs(free).max(initial=0.0))
        descent = curvature.descent(free)
        descent *= min(1.0, reach / max(float(np.abs(descent).max(initial=0.0)), 1e-300))
        if residual <= tolerance or iteration == limit:
            break
        if iteration and iteration % patience == 0:
            preconditioner.renew(at)
            project = _Projection(preconditioner, constraint)
            curvature.solve = project.solve
        before = slope
        step, slope = _line_search(gradient, at, slope, descent)
        curvature.learn(step, slope - before)
        at = at + step
    return Minimum(at, free, residual, descent, multiplier, iteration, residual <= tolerance)


def _line_search(
    gradient: Callable[[np.ndarray], np.ndarray], at: np.ndarray, slope: np.ndarray, descent: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A step along `descent` that lowers the slope along it, and the gradient there."""
    first = low_slope = float(slope @ descent)
    length, low = 1.0, 0.0
    for trial in range(12):
        there = gradient(at + length * descent)
        now = float(there @ descent)
        if abs(now) <= 0.9 * abs(first) or (now < 0 and length > 4) or trial == 11:
            break
        if now > 0:  # beyond a minimum: go back to where the slopes interpolate to zero
            length = low + (length - low) * float(np.clip(low_slope / (low_slope - now), 0.1, 0.9))
        else:
            low, low_slope, length = length, now, 2 * length
    return length * descent, there


class _Projection:
    """The preconditioner within the plane on which the constraint keeps its value."""

    def __init__(self, preconditioner: Preconditioner, constraint: np.ndarray | None):
        self.inner, self.constraint = preconditioner.solve, constraint
        if constraint is not None:
            self.response = preconditioner.solve(constraint)
            self.response /= constraint @ self.response

    def solve(self, gradient: np.ndarray) -> np.ndarray:
        """P M⁻¹ Pᵀ g: the exact inverse of M within the plane."""
        if self.constraint is None:
            return self.inner(gradient)
        v = self.inner(gradient - self.constraint * (self.response @ gradient))
        return v - self.response * (self.constraint @ v)

    def split(self, gradient: np.ndarray) -> tuple[np.ndarray, float]:
        """The gradient without the force of the constraint (least squares), and that force."""
        if self.constraint is None:
            return gradient, 0.0
        force = float(self.constraint @ gradient / (self.constraint @ self.constraint))
        return gradient - force * self.constraint, force
