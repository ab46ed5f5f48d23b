"""Newton's method on the surrogate, inside the grid, from every node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

EDGE = 1e-6  # of the range: nearer to a bound than this is on it


class Smooth(Protocol):
    """A function of d parameters, of (f_max, delta_max) first of all, with exact derivatives on a box."""

    @property
    def lower(self) -> np.ndarray: ...
    @property
    def upper(self) -> np.ndarray: ...
    def value(self, parameters: np.ndarray) -> np.ndarray: ...
    def gradient(self, parameters: np.ndarray) -> np.ndarray: ...
    def hessian(self, parameters: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class Minimum:
    """Where Newton's method ended.

    Parameters
    ----------
    position : (d,) array; f_max in N and delta_max in m, further parameters after them
    value : float; the function there
    hessian : (d, d) array, unscaled
    converged : bool; gradient and step below tolerance, or held by a bound
    interior : bool; on no bound
    iterations : int
    """

    position: np.ndarray
    value: float
    hessian: np.ndarray
    converged: bool
    interior: bool
    iterations: int

    @property
    def convex(self) -> bool:
        """Whether the Hessian is positive definite; asked in the unit in which its diagonal is one."""
        diagonal = np.diag(self.hessian)
        if not (np.isfinite(self.hessian).all() and (diagonal > 0).all()):
            return False
        scale = np.sqrt(diagonal)
        return bool(np.linalg.eigvalsh(self.hessian / np.outer(scale, scale))[0] > 5e-10)

    @property
    def status(self) -> str:
        """How it ended, in a sentence."""
        if not self.converged:
            return f"Newton's method did not converge in {self.iterations} iterations."
        if not self.interior:
            return "The minimum lies on the edge of the grid."
        if not self.convex:
            return "The Hessian at the stationary point is not positive definite."
        return f"Newton's method converged to a minimum inside the grid in {self.iterations} iterations."


def minimise(function: Smooth, starts: np.ndarray, tolerance: float = 1e-9) -> list[Minimum]:
    """Distinct minima on the box from several starts, the lowest first.

    Parameters
    ----------
    function : Smooth
    starts : (k, d) array, inside the box
    tolerance : float; of the step, as a share of the box

    Returns
    -------
    list of Minimum; those that did not converge come last
    """
    found = sorted((_descend(function, np.asarray(s, float), tolerance) for s in starts), key=_rank)
    distinct: list[Minimum] = []
    size = function.upper - function.lower
    for one in found:
        if not any(np.all(np.abs(one.position - other.position) < 1e-4 * size) for other in distinct):
            distinct.append(one)
    return distinct


def _rank(minimum: Minimum) -> tuple[bool, float]:
    return not minimum.converged, minimum.value


def _descend(function: Smooth, start: np.ndarray, tolerance: float, limit: int = 100) -> Minimum:
    """Projected Newton iteration: bounds that push are held, steps are shortened until the value falls enough."""
    low, size = function.lower, function.upper - function.lower
    x, done, wanted, iteration = (start - low) / size, False, np.inf, 0
    while not done and iteration < limit:
        iteration += 1
        gradient = function.gradient(low + size * x) * size
        hessian = function.hessian(low + size * x) * np.outer(size, size)
        free = ~(((x <= 0) & (gradient > 0)) | ((x >= 1) & (gradient < 0)))
        step = _step(gradient, hessian, free)
        trial = _shorten(function, x, step, gradient)
        done = bool(np.abs(trial - x).max() <= tolerance)
        wanted = np.abs(np.clip(x + step, 0, 1) - x).max()
        x = trial
    position = np.clip(low + size * x, function.lower, function.upper)
    interior = bool(np.all((x > EDGE) & (x < 1 - EDGE)))
    # round-off of the value stops the descent while the full step is still about its square root
    converged = done and bool(wanted < 1e-5)
    return Minimum(
        position, float(function.value(position)), function.hessian(position), converged, interior, iteration
    )


def _step(gradient: np.ndarray, hessian: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Newton's step of the free parameters; where the Hessian is not positive definite, along its absolute value.

    Turning negative curvatures round keeps the step downhill and off saddle points; at most half the box.
    """
    step = np.zeros_like(gradient)
    if not free.any():
        return step
    curvature, axes = np.linalg.eigh(hessian[np.ix_(free, free)])
    slope = axes.T @ gradient[free]
    floor = np.maximum(np.abs(curvature), 1e-8 * np.abs(curvature).max())
    ratio = np.divide(slope, floor, out=np.sign(slope), where=floor > 0)
    step[free] = -axes @ ratio
    return step * min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))


def _shorten(function: Smooth, x: np.ndarray, step: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """The first of x + step, x + step/2, … inside the box whose value falls enough (Armijo); x where none does."""
    low, size = function.lower, function.upper - function.lower
    now = float(function.value(low + size * x))
    for halving in range(40):
        trial = np.clip(x + step * 0.5**halving, 0, 1)
        fall = gradient @ (trial - x)
        if fall <= 0 and function.value(low + size * trial) <= now + 1e-4 * fall:
            return trial
    return x
