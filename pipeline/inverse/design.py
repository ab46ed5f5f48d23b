"""The grid of parameters at which the fracture test is simulated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.errors import InputError

PAPER_FACTORS = (0.8, 0.9, 1.0, 1.1, 1.2)


@dataclass(frozen=True)
class Design:
    """A tensor grid of (f_max, delta_max): centre times factors (Hill et al. 2017, Fig. 8).

    Parameters
    ----------
    centre : (f_max, delta_max) in N and m
    f_factors, delta_factors : increasing positive numbers, at least three each
    """

    centre: tuple[float, float]
    f_factors: tuple[float, ...] = PAPER_FACTORS
    delta_factors: tuple[float, ...] = PAPER_FACTORS

    def __post_init__(self) -> None:
        if not (np.isfinite(self.centre).all() and min(self.centre) > 0):
            raise InputError(f"the centre of the grid is {self.centre}: f_max (N) and delta_max (m) must be positive")
        for name, factors in (("f_max", self.f_factors), ("delta_max", self.delta_factors)):
            if len(factors) < 3 or not (factors[0] > 0 and (np.diff(factors) > 0).all()):
                raise InputError(
                    f"the grid's factors of {name} are {factors}: at least three, positive and increasing, are needed"
                )

    @property
    def f_max(self) -> np.ndarray:
        """Grid lines of f_max (N); (n_f,)."""
        return self.centre[0] * np.array(self.f_factors)

    @property
    def delta_max(self) -> np.ndarray:
        """Grid lines of delta_max (m); (n_d,)."""
        return self.centre[1] * np.array(self.delta_factors)

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.f_factors), len(self.delta_factors)

    def nodes(self) -> list[tuple[float, float]]:
        """All (f_max, delta_max), delta_max running fastest; equal nodes of moved grids are equal to the bit."""
        return [(float(f), float(d)) for f in self.f_max for d in self.delta_max]

    def moved(self, f_steps: int, delta_steps: int) -> Design:
        """The grid moved by whole steps; lines that both grids hold stay the same to the bit.

        It moves down only as far as all factors stay positive.
        """
        return replace(
            self, f_factors=_moved(self.f_factors, f_steps), delta_factors=_moved(self.delta_factors, delta_steps)
        )

    def recentred(self, f_max: float, delta_max: float, steps: int = 2) -> Design:
        """The grid moved by `steps` towards an optimum on its edge; the same grid if it lies inside."""
        return self.moved(
            steps * _side(f_max, self.f_max),
            steps * _side(delta_max, self.delta_max),
        )

    def is_edge(self, f_max: float, delta_max: float) -> bool:
        """Whether a point lies on the grid's edge or outside it."""
        return any((_side(f_max, self.f_max), _side(delta_max, self.delta_max)))


def _moved(factors: tuple[float, ...], steps: int) -> tuple[float, ...]:
    line = list(factors)
    for _ in range(abs(steps)):
        new = 2 * line[-1] - line[-2] if steps > 0 else 2 * line[0] - line[1]
        new = round(new, 12)  # 1.3 stays 1.3, so that a node met again is recognised
        if new <= 0:
            break
        line = [*line[1:], new] if steps > 0 else [new, *line[:-1]]
    return tuple(line)


def _side(value: float, lines: np.ndarray) -> int:
    """−1 at or below the lowest line, +1 at or above the highest, 0 inside."""
    slack = 1e-6 * (lines[-1] - lines[0])
    return int(value >= lines[-1] - slack) - int(value <= lines[0] + slack)
