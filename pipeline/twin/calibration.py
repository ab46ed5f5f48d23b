"""Factors that make the irregular network stand for the continuum of the hexagonal lattice."""

from __future__ import annotations

from pipeline.twin.problem import Factors


def calibrated_factors() -> Factors:
    """The factors in force."""
    return Factors(stiffness=1.056, strength=1.03, opening=0.69)
