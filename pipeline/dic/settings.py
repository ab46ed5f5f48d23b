"""What a correlation may be told; no crack geometry is among it."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

from pipeline.core.errors import InputError

MODELS = ("translation", "rigid", "affine")


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Settings:
    """How to correlate.

    Parameters
    ----------
    subset_size_px : int, odd; 25 in Poissant & Barthelat (2010)
    grid_step_px : int
    roi_px : (column, row, width, height) of the region of interest; None is the whole picture
    model : warp of a subset, "translation", "rigid" or "affine"
    search_px : int; motion against the start that the search for seeds covers
    split : bool; cut subsets whose affine match is poor
    max_iterations, tolerance_px : of Gauss–Newton; the tolerance is on the motion of a typical pixel
    accept_zncc : float; least correlation of a point that hands its warp to its neighbours
    imprecise_px : float; points fail whose standard deviation is above it and above three times the usual one
    threads : int
    """

    subset_size_px: int = 25
    grid_step_px: int = 6
    roi_px: tuple[int, int, int, int] | None = None
    model: str = "affine"
    search_px: int = 100
    split: bool = True
    max_iterations: int = 30
    tolerance_px: float = 1e-3
    accept_zncc: float = 0.7
    imprecise_px: float = 0.06
    threads: int = field(default_factory=_cores)

    def __post_init__(self) -> None:
        rules = {
            f"subset_size_px must be odd and 5 to 201, got {self.subset_size_px}": self.subset_size_px % 2
            and 5 <= self.subset_size_px <= 201,
            f"grid_step_px must be at least 1, got {self.grid_step_px}": self.grid_step_px >= 1,
            f"model must be one of {MODELS}, got {self.model!r}": self.model in MODELS,
            f"search_px must not be negative, got {self.search_px}": self.search_px >= 0,
            f"accept_zncc must lie between 0 and 1, got {self.accept_zncc:g}": 0 < self.accept_zncc < 1,
            f"threads must be at least 1, got {self.threads}": self.threads >= 1,
        }
        broken = [rule for rule, kept in rules.items() if not kept]
        if broken:
            raise InputError("; ".join(broken))

    @property
    def half(self) -> int:
        return self.subset_size_px // 2

    def solver(self) -> dict[str, float | int]:
        """The part that the compiled core is told."""
        return {
            "half": self.half,
            "model": MODELS.index(self.model),
            "max_iterations": self.max_iterations,
            "tolerance": self.tolerance_px,
            "wander": float(max(self.half, 6)),
            "threads": self.threads,
        }
