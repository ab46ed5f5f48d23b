"""The report of a diagnosis, for a laboratory engineer to act on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.gap.diagnosis import Diagnosis
from pipeline.gap.effects import effect
from pipeline.gap.identifiability import DETECTED
from pipeline.gap.observation import STAGES
from pipeline.gap.score import NONE
from pipeline.report.diagnosis import (
    closures,
    detectability,
    difference_map,
    differences,
    load_difference,
    loads,
    ranking,
    where_map,
)
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.style import Draw, png
from pipeline.store.atomic import write_atomically
from pipeline.study.diagnose_arrays import reading_of, shown, whole_curve
from pipeline.study.diagnose_case import Case
from pipeline.study.diagnose_words import (
    CALLED,
    alike,
    amount,
    closure_row,
    likely,
    next_section,
    verdict_section,
    where_told,
)
from pipeline.study.pages import picture, write_page

WIDE = {"width": 190.0, "height": 66.0}  # mm


def diagnosis_page(case: Case, diagnosis: Diagnosis, result: Mapping[str, Any]) -> None:
    """Figures and report.html of a diagnosis."""
    folder = case.folder
    sections = [
        verdict_section(result, case.look.remarks),
        _where(folder, diagnosis, result),
        _which(folder, diagnosis, result),
        _how_far(case, diagnosis, result),
        unseen_section(folder, result),
        next_section(result),
    ]
    text = page(
        case.bundle.name, sections, subtitle="sim-to-real gap", warnings=result["warnings"], footer=footer(result)
    )
    write_page(folder, text)


def footer(result: Mapping[str, Any]) -> list[str]:
    return [
        f"cohesive-bpm {result['version']}",
        f"engine {result['engine']}",
        f"{result['simulations']} simulations",
        f"{result['seconds']:.0f} s, of these {result['seconds_simulating']:.0f} s simulating",
    ]


def _where(folder: Path, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    cells = result["where"]
    figures = where_figures(folder, cells)
    if d.observation.has_load:
        before, told = reading_of(d, d.fits[NONE]), "Load of the model as it is: difference at every station."
        figures.append(
            picture(folder, "where_load", lambda a: load_difference(a, d.observation, before, load_std(d)), told)
        )
    if d.observation.has_field:
        figures.insert(0, _arrows(folder, d))
    return Section("Where test and simulation part", text=where_told(cells), figures=figures)


def where_figures(folder: Path, cells: list[dict[str, Any]]) -> list[Figure]:
    """Maps of region × mode by stage, against what engines differ by and against noise."""
    figures: list[Figure] = []
    if not any(c["channel"] == "field" for c in cells):
        return figures
    for against, words in (("z_gap", "noise and engine discrepancy"), ("z_noise", "noise alone")):
        panels = [_panel(cells, stage, against) for stage in STAGES]
        data = png(*panels, columns=3, **WIDE)
        write_atomically(folder / f"where_{against}.png", data)
        told = (
            f"Model as it is: how many times larger the difference is than {words} would give (1 is expected); below "
            "it the difference itself, root mean square in µm (load: N)."
        )
        figures.append(Figure(data, told, wide=True))
    return figures


def _panel(cells: list[dict[str, Any]], stage: str, against: str) -> Draw:
    return lambda axes: where_map(axes, cells, stage, against)


def field_std(d: Diagnosis) -> np.ndarray:
    """Standard deviation (s, p), m, of noise and discrepancy; NaN where nothing is judged."""
    o = d.observation
    whole = np.full(o.mask.size, np.nan)
    whole[o.mask] = d.data.metric.std
    return np.sqrt(np.mean(whole[: o.reading.field.size].reshape(o.reading.field.shape) ** 2, axis=2))


def load_std(d: Diagnosis) -> np.ndarray:
    """The same of the load (s,), N."""
    whole = np.full(d.observation.mask.size, np.nan)
    whole[d.observation.mask] = d.data.metric.std
    return whole[d.observation.reading.field.size :]


def _arrows(folder: Path, d: Diagnosis) -> Figure:
    before, std = reading_of(d, d.fits[NONE]), field_std(d)
    left = np.where(np.isfinite(std)[..., None], d.observation.reading.field - before.field, 0.0)
    longest = max(float(np.nanmax(np.hypot(left[..., 0], left[..., 1]))), 1e-9)
    panels: list[Draw] = [
        lambda axes, k=k: difference_map(axes, d.observation, before, std, k, longest)  # type: ignore[misc]
        for k in range(len(STAGES))
    ]
    data = png(*panels, columns=3, **WIDE)
    write_atomically(folder / "where_points.png", data)
    told = "Measured minus simulated displacement, model as it is; last station of every stage (triangle: notch tip)."
    return Figure(data, told, wide=True)


def _which(folder: Path, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    figure = picture(folder, "ranking", lambda a: ranking(a, d.scored.probability), "Probability of each explanation.")
    return Section("Which effect", numbers=likely(result), figures=[figure], notes=alike(result))


def _how_far(case: Case, d: Diagnosis, result: Mapping[str, Any]) -> Section:
    fitted = shown(d)[:3]
    names = [CALLED.get(f.candidate.label, f"with {f.candidate.label}") for f in fitted]
    figures = []
    if d.observation.has_load:
        curves = {n: whole_curve(d, f) for n, f in zip(names, fitted, strict=True)}
        curve = case.bundle.curve
        record = None if curve is None else (curve.cmod, curve.load)
        figures.append(
            picture(
                case.folder, "curve", lambda a: loads(a, d.observation, curves, record, load_std(d)),
                "Load before and after; the runner-up beside it.",
            )
        )  # fmt: skip
    if d.observation.has_field:
        readings = {n: reading_of(d, f) for n, f in zip(names, fitted, strict=True)}
        told = "Displacements: root mean square difference at every station, before and after."
        figures.append(
            picture(case.folder, "difference", lambda a: differences(a, d.observation, readings, field_std(d)), told)
        )
    if any(c["fraction"] is not None for c in result["closure"].values()):
        told = "Share of the gap closed on data that were not used, first explanation and runners-up."
        figures.append(picture(case.folder, "closure", lambda a: closures(a, result["closure"]), told))
    notes = ["A wrong effect can close a gap as well as the right one: only transfer to other tests decides."]
    numbers = [closure_row(label, c) for label, c in result["closure"].items()]
    return Section("How far the gap closes", numbers=numbers, figures=figures, notes=notes)


def unseen_section(folder: Path, result: Mapping[str, Any]) -> Section:
    """Detection limits, and what stays possible whatever was found."""
    limits = result["detection_limit"]
    figure = picture(folder, "detectability", lambda a: detectability(a, limits, DETECTED), "What could be seen.")
    rows = []
    for name, row in sorted(limits.items(), key=lambda item: -item[1]["d_prime_at_most"]):
        size = effect(name).magnitude
        plausible = f"plausible: {size.low:g} to {amount(size.high, size.unit)}"
        value = "not seen" if row["value"] is None else f"from {amount(row['value'], row['unit'])}"
        rows.append(Number(name, value, f"{effect(name).says}; {plausible}"))
    hidden = ", ".join(result["cannot_exclude"])
    notes = [f"cannot be excluded: {hidden}" if hidden else "every effect of the library would have been seen"]
    notes += [f"not tested: {n} ({reason})" for n, reason in result["not_tested"].items()]
    return Section("What these data can and cannot show", numbers=rows, figures=[figure], notes=notes)
