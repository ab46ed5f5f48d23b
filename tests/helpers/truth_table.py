"""Rows of the truth table of a blind check."""

from __future__ import annotations


def row(effect: str | None = None, specimen: str = "a", kind: str | None = None, **more: object) -> dict:
    """A case with one effect of size one at twice its limit, or with none."""
    effects = {effect: 1.0} if effect else {}
    return {
        "specimen": specimen, "kind": kind or ("effect" if effect else "none"), "effects": effects,
        "f_max_n": 100.0, "delta_max_m": 1e-4, "multiple": 2.0, **more,
    }  # fmt: skip
