"""The command `library compare`: identified mixtures side by side."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from pipeline import __version__
from pipeline.core.errors import InputError
from pipeline.report.mixtures import against_temperature, parameter_plane
from pipeline.report.page import Number, Section, page
from pipeline.store.library import Filter, Library, LibraryEntry
from pipeline.store.results import write_result
from pipeline.study.output import plain_folder
from pipeline.study.pages import picture, write_page

MOST = 40  # entries side by side: more cannot be read


def compare(library: Path, out: Path, wanted: Filter) -> str:
    """Compare the entries that are meant; writes result.json, figures and report.

    Raises
    ------
    InputError
        for fewer than two entries, or more than can be shown
    """
    started = time.monotonic()
    entries = Library(library).entries(wanted)
    if not 2 <= len(entries) <= MOST:
        raise InputError(
            f"{len(entries)} entries of {library} are meant: 2 to {MOST} can be compared, see library list"
        )
    folder = plain_folder(out, "library compare")
    pairs = [pair(first, second) for first, second in combinations(entries, 2)]
    result: dict[str, Any] = {
        "version": __version__,
        "command": "library compare",
        "seconds": time.monotonic() - started,
        "library": str(library),
        "entries": [summary_of(entry) for entry in entries],
        "groups": groups(entries),
        "pairs": pairs,
    }
    write_result(folder, result)
    _page(folder, entries, result)
    return "\n".join(_sentence(row) for row in pairs if row["differs"])


def summary_of(entry: LibraryEntry) -> dict[str, Any]:
    """What is compared of an entry, free of radius and thickness."""
    return {
        "key": entry.key,
        "mixture": entry.mixture,
        "bundle": entry.bundle,
        "geometry": entry.geometry,
        "temperature_c": entry.temperature_c,
        "traction_mpa": entry.traction_mpa,
        "strength_mpa": entry.strength_mpa,
        "delta_max_m": entry.delta_max_m,
        "energy_j_per_m2": entry.energy_j_per_m2,
    }


def groups(entries: Sequence[LibraryEntry]) -> list[dict[str, Any]]:
    """Replicates, of one mixture, geometry and temperature, with their mean and coefficient of variation."""
    found: dict[tuple[str, str, str], list[LibraryEntry]] = {}
    for entry in entries:
        found.setdefault((entry.mixture, entry.geometry, f"{entry.temperature_c:g}"), []).append(entry)
    return [_group(members) for members in found.values()]


def _group(members: list[LibraryEntry]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "mixture": members[0].mixture,
        "geometry": members[0].geometry,
        "temperature_c": members[0].temperature_c,
        "tests": len(members),
    }
    for name in ("traction_mpa", "delta_max_m", "energy_j_per_m2"):
        values = np.array([getattr(entry, name) for entry in members])
        spread = float(values.std(ddof=1) / values.mean()) if values.size > 1 else math.nan
        row[name] = {"mean": float(values.mean()), "coefficient_of_variation": spread}
    return row


def pair(first: LibraryEntry, second: LibraryEntry) -> dict[str, Any]:
    """Ratios of two entries, and the chance of so large a difference if there were none.

    The difference of (ln f_max/(2 r t), ln delta_max) is weighed by the sum of both covariances: chi-square of
    two degrees of freedom. Where a covariance is unknown there is no such chance. Scatter between replicates
    is not in it: see the groups.
    """
    off = np.log([second.traction_mpa / first.traction_mpa, second.delta_max_m / first.delta_max_m])
    covariance = first.log_covariance + second.log_covariance
    chance = math.nan
    if np.isfinite(covariance).all() and np.linalg.det(covariance) > 0:
        chance = float(chi2.sf(off @ np.linalg.solve(covariance, off), 2))
    return {
        "first": first.key,
        "second": second.key,
        "traction_ratio": float(np.exp(off[0])),
        "delta_max_ratio": float(np.exp(off[1])),
        "energy_ratio": second.energy_j_per_m2 / first.energy_j_per_m2,
        "chance": chance,
        "differs": chance < 0.05,
    }


def _page(folder: Path, entries: Sequence[LibraryEntry], result: dict[str, Any]) -> None:
    mixture = [entry.mixture for entry in entries]
    traction = np.array([entry.traction_mpa for entry in entries])
    opening = np.array([entry.delta_max_m for entry in entries])
    spread = np.array([entry.log_covariance for entry in entries])
    level = np.array([entry.temperature_c for entry in entries])
    energy = np.array([entry.energy_j_per_m2 for entry in entries])
    figures = [
        picture(
            folder,
            "parameters",
            lambda a: parameter_plane(a, traction, opening, spread, mixture),
            "Estimates with their 95 % regions; traction is free of radius and thickness.",
        )
    ]
    if np.isfinite(level).any():
        bounds = np.array([np.array(entry.f_max_95_n) / entry.bond_area_mm2 for entry in entries])
        doubt = np.array([entry.energy_95_j_per_m2 for entry in entries])
        figures += [
            picture(
                folder,
                "traction",
                lambda a: against_temperature(a, level, traction, bounds, mixture, "$f_{max}/(2rt)$ (MPa)"),
                "Traction over temperature, 95 % intervals.",
            ),
            picture(
                folder,
                "energy",
                lambda a: against_temperature(a, level, energy, doubt, mixture, "$f_{max}\\delta_{max}/(2rt)$ (J/m²)"),
                "Energy over temperature, 95 % intervals.",
            ),
        ]
    numbers = [_number(entry) for entry in entries]
    notes = [_sentence(row) for row in result["pairs"] if row["differs"]] or ["No two estimates differ beyond 95 %."]
    sections = [
        Section("Estimates", numbers=numbers, figures=figures),
        Section("Differences", text="Of the estimates; scatter between specimens is not in them.", notes=notes),
        Section("Replicates", numbers=[_replicates(row) for row in result["groups"]]),
    ]
    footer = [f"cohesive-bpm {result['version']}, command library compare"]
    write_page(folder, page("Identified mixtures", sections, subtitle=f"{len(entries)} tests", footer=footer))


def _number(entry: LibraryEntry) -> Number:
    at = "" if math.isnan(entry.temperature_c) else f", {entry.temperature_c:g} °C"
    value = f"{entry.traction_mpa:.3g} MPa, {entry.delta_max_m:.3g} m, {entry.energy_j_per_m2:.0f} J/m²"
    return Number(f"{entry.key} {entry.mixture}", value, f"{entry.bundle}, {entry.geometry}{at}")


def _replicates(row: dict[str, Any]) -> Number:
    at = "" if math.isnan(row["temperature_c"]) else f", {row['temperature_c']:g} °C"
    spread = row["traction_mpa"]["coefficient_of_variation"]
    remark = "one test only" if math.isnan(spread) else f"traction scatters by {spread:.1%} between specimens"
    value = f"{row['traction_mpa']['mean']:.3g} MPa, {row['energy_j_per_m2']['mean']:.0f} J/m²"
    return Number(f"{row['mixture']}, {row['geometry']}{at}, {row['tests']} tests", value, remark)


def _sentence(row: dict[str, Any]) -> str:
    return (
        f"{row['second']} against {row['first']}: traction × {row['traction_ratio']:.3g}, delta_max × "
        f"{row['delta_max_ratio']:.3g}, energy × {row['energy_ratio']:.3g} (chance if there were none "
        f"{row['chance']:.2g})"
    )
